"""A device that is opened again by itself after it was lost, with growing pauses, holding nothing else up."""

from __future__ import annotations

import contextlib
import time

from glovecal_client.capture.device import Device, Reading
from glovecal_client.errors import DeviceError, DeviceLost, reason_of

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
