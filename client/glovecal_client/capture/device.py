"""What a capture device is, and where devices are found (entry-point group ``glovecal.devices``).

One that was lost is opened again by itself, with growing pauses, holding nothing else up.
"""

from __future__ import annotations

import contextlib
import math
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib import metadata
from typing import Protocol, runtime_checkable

import numpy as np

from glovecal_client.errors import BadName, BadOption, DeviceError, DeviceLost, UnknownDevice, reason_of
from glovecal_client.installation import not_installed
from glovecal_client.keys import check_channel_name, did_you_mean
from glovecal_client.wire.frame import MAX_CONTEXT, MAX_SENSORS

DEVICE_GROUP = "glovecal.devices"


def _no_values() -> np.ndarray:
    return np.empty(0, np.float32)


@dataclass(frozen=True, slots=True, eq=False)
class Reading:
    """What a device gives for one instant: raw values and the time they were taken."""

    readings: np.ndarray
    """Raw sensor values, float32, shape (S,)."""
    monotonic_ns: int
    """``clock_ns()`` of ``glovecal_client.clock`` when the reading was complete."""
    wall_ns: int
    """``wall_ns()`` at the same instant."""
    context: np.ndarray = field(default_factory=_no_values)
    """Context values, float32, shape (C,); NaN where not measured."""
    button: bool = False


@runtime_checkable
class Device(Protocol):
    """A source of readings. It says what it produces before it is opened.

    More attributes are looked at if the device has them: ``counts``, the pair of smallest and largest
    raw value its hardware can send; ``hand``, one of ``left``, ``right``, ``unknown``; ``counters`` with
    ``bad_frames``, the records thrown away since they came damaged, and perhaps ``last_refused``, the last of
    them and why; ``notice``, a sentence for the user;
    ``option_help`` of the class, what each option may be, by the option's name; ``about`` of the class, a
    sentence that tells which glove it reads, and ``usage``, what stands behind ``--device`` for it, with PORT
    or FILE for what differs; ``own_clock``, how the glove's clock stands against the computer's;
    ``commands``, what it can be asked beside its stream, with an explanation each, and ``command(name,
    argument)``, which does it and returns a document.
    """

    @property
    def name(self) -> str:
        """What to call it in sentences and in the meta."""
        ...

    @property
    def layout(self) -> str:
        """Name of the layout whose sensors it has."""
        ...

    @property
    def sensors(self) -> tuple[str, ...]:
        """Names of the values of a reading, in order."""
        ...

    @property
    def context(self) -> tuple[str, ...]:
        """Names of the context values of a reading, in order."""
        ...

    @property
    def simulated(self) -> bool:
        """Whether its readings are made up."""
        ...

    @property
    def rate_hz(self) -> float:
        """Nominal readings a second."""
        ...

    @classmethod
    def from_options(cls, argument: str | None, options: Mapping[str, str]) -> Device:
        """Build it from ``--device NAME:ARGUMENT --option key=value``. Raises BadOption."""
        ...

    def open(self) -> None:
        """Start, also again after a close. Raises DeviceLost if not there, DeviceError if it cannot work."""
        ...

    def close(self) -> None:
        """Stop and let go of the hardware; harmless when already closed."""
        ...

    def read(self, timeout_s: float) -> Reading | None:
        """The next reading, or None if there was none in time. Raises DeviceLost, DeviceFinished."""
        ...


def check_description(device: Device) -> None:
    """Raise DeviceError if what a device says about itself cannot be: names, numbers, its rate."""
    names = (*device.sensors, *device.context)
    try:
        for name in names:
            check_channel_name(name, f"device {device.name!r}")
    except BadName as error:
        raise DeviceError(str(error)) from error
    if not 1 <= len(device.sensors) <= MAX_SENSORS or len(device.context) > MAX_CONTEXT:
        raise DeviceError(
            f"device {device.name!r} has {len(device.sensors)} sensors and {len(device.context)} context "
            f"values; allowed are 1 to {MAX_SENSORS} and 0 to {MAX_CONTEXT}"
        )
    if len(set(names)) != len(names):
        raise DeviceError(f"device {device.name!r} names a sensor or context value more than once")
    if not 0 < device.rate_hz < math.inf:
        raise DeviceError(f"device {device.name!r} states a rate of {device.rate_hz} Hz")


def device_names() -> list[str]:
    """Names of all installed devices."""
    return sorted({point.name for point in metadata.entry_points(group=DEVICE_GROUP)})


def check_options(device: str, given: Mapping[str, str], option_help: Mapping[str, str]) -> None:
    """Raise BadOption, with the options there are, for one that the device does not have."""
    unknown = sorted(set(given) - set(option_help))
    if unknown:
        raise BadOption(f"{device}: no option {unknown[0]!r}; there are {_listed(option_help)}")


@dataclass(frozen=True)
class InstalledDevice:
    """What a list of devices tells of one."""

    name: str
    usage: str
    """Behind ``--device``; PORT and FILE stand for what differs."""
    about: str
    """A sentence; of one that cannot be used here, why."""


def installed_devices() -> list[InstalledDevice]:
    """By name, also those of a user's own."""
    return [_described(name) for name in device_names()]


def _described(name: str) -> InstalledDevice:
    try:
        device = _device_class(name)
    except DeviceError as error:
        return InstalledDevice(name, name, str(error))
    about = getattr(device, "about", "A driver that was installed on this computer.")
    return InstalledDevice(name, str(getattr(device, "usage", name)), str(about))


def device_options() -> list[str]:
    """One sentence for each installed device: its options and what they may be."""
    sentences = []
    for name in device_names():
        try:
            option_help = getattr(_device_class(name), "option_help", None)
        except DeviceError as error:
            sentences.append(str(error))
            continue
        if option_help:
            sentences.append(f"Options of {name}: {_listed(option_help)}")
    return sentences


def _listed(option_help: Mapping[str, str]) -> str:
    return "; ".join(f"{name}={values}" for name, values in option_help.items())


def build_device(text: str, options: Mapping[str, str] | None = None) -> Device:
    """The device written ``NAME`` or ``NAME:ARGUMENT``, not yet opened. Raises UnknownDevice, DeviceError."""
    name, colon, argument = text.partition(":")
    return _device_class(name).from_options(argument if colon else None, options or {})


def _device_class(name: str) -> type[Device]:
    for point in metadata.entry_points(group=DEVICE_GROUP):
        if point.name == name:
            try:
                return point.load()
            except ImportError as error:
                raise DeviceError(not_installed(f"device {name!r}", error.name or point.module)) from error
    known = device_names()
    raise UnknownDevice(f"no device {name!r}; {did_you_mean(name, known, there='installed are')}")


_FIRST_PAUSE_S = 0.1
_LONGEST_PAUSE_S = 1.0
"""A glove that is plugged in again is back within 2 s: this pause, and opening it."""


class ReopeningDevice:
    """Reads a device, opening it when that is due. Pauses between tries double from 0.1 s to 1 s."""

    def __init__(self, device: Device) -> None:
        self._device = device
        self._pause_s = _FIRST_PAUSE_S
        self._next_try = 0.0
        self.is_open = False
        self.openings: int = 0
        """How often it was opened."""

    def read(self, timeout_s: float) -> Reading | None:
        """The next reading, or None. Raises DeviceLost once per loss or failed try, other DeviceErrors too.

        A device is foreign code, perhaps a user's own: any other exception of it counts as a loss.
        """
        if not self.is_open:
            remaining = self._next_try - time.monotonic()
            if remaining > 0:
                time.sleep(min(remaining, timeout_s))
                return None
        try:
            if not self.is_open:
                self._open()
            return self._device.read(timeout_s)
        except Exception as error:
            self._put_off()
            if isinstance(error, DeviceError):
                raise
            raise DeviceLost(f"{self._device.name}: {reason_of(error)}") from error

    def _open(self) -> None:
        self._device.open()
        self.is_open = True
        self.openings += 1

    def _put_off(self) -> None:
        if self.is_open:
            self._pause_s = _FIRST_PAUSE_S
        self.close()
        self._next_try = time.monotonic() + self._pause_s
        self._pause_s = min(2 * self._pause_s, _LONGEST_PAUSE_S)

    def close(self) -> None:
        """Close the device; one that is gone may complain, which tells nothing new."""
        self.is_open: bool = False
        with contextlib.suppress(Exception):
            self._device.close()
