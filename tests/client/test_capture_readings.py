"""Which readings become frames, and how a lost device comes back."""

from __future__ import annotations

import time

import numpy as np
import pytest
from loopback import eventually
from signal_generator import SignalGenerator, values_of

from glovecal_client.capture.daemon import ReadingCheck
from glovecal_client.capture.device import (
    Device,
    Reading,
    ReopeningDevice,
    build_device,
    check_description,
    device_names,
)
from glovecal_client.errors import DeviceError, DeviceFinished, DeviceLost, UnknownDevice


def check() -> tuple[SignalGenerator, ReadingCheck]:
    device = SignalGenerator()
    return device, ReadingCheck(device)


@pytest.mark.parametrize(
    ("values", "sentence"),
    [
        (np.zeros(3, np.float32), "3 sensor values instead of 4"),
        (np.zeros(0, np.float32), "0 sensor values instead of 4"),
        (np.zeros((4, 1), np.float32), "shape"),
        (np.array([0, np.nan, 0, 0], np.float32), "sensor B reads nan"),
        (np.array([0, 0, 0, np.inf], np.float32), "sensor D reads inf"),
        (np.array([0, 0, -1, 0], np.float32), "sensor C reads -1, outside 0 to 4095"),
        (np.array([4096, 0, 0, 0], np.float32), "sensor A reads 4096, outside 0 to 4095"),
    ],
)
def test_bad_values_are_refused_by_name(values: np.ndarray, sentence: str) -> None:
    device, checking = check()
    assert sentence in str(checking.fault(device.reading(0, values=values)))
    assert checking.fault(device.reading(1)) is None


def test_bad_context_is_refused_but_missing_context_is_not() -> None:
    _, checking = check()
    now = time.monotonic_ns()
    assert "0 context values instead of 1" in str(checking.fault(Reading(values_of(0), now, 0)))
    infinite = Reading(values_of(0), now, 0, context=np.array([np.inf], np.float32))
    assert "context supply_v is infinite" in str(checking.fault(infinite))
    missing = Reading(values_of(0), now, 0, context=np.array([np.nan], np.float32))
    assert checking.fault(missing) is None


def test_time_must_go_forward_and_not_lie_in_the_future() -> None:
    device, checking = check()
    first = device.reading(0)
    assert checking.fault(first) is None
    assert checking.is_duplicate(first)
    earlier = device.reading(1, monotonic_ns=first.monotonic_ns - 2_000_000)
    assert "2 ms before" in str(checking.fault(earlier))
    future = device.reading(2, monotonic_ns=time.monotonic_ns() + 10**13)
    assert "in the future" in str(checking.fault(future))
    assert checking.fault(device.reading(3)) is None


@pytest.mark.parametrize(
    ("reading", "sentence"),
    [
        (Reading(np.array(["a", "b", "c", "d"]), 1, 1), "no numbers"),
        (Reading(np.array([1e300, 0, 0, 0]), 1, 1, context=np.zeros(1)), "sensor A reads inf"),
        (Reading(values_of(0), 1.5, 1, context=np.zeros(1)), "its time 1.5"),  # type: ignore[arg-type]
        (Reading(values_of(0), 1, 1 << 63, context=np.zeros(1)), "whole number of nanoseconds"),
    ],
)
def test_what_a_careless_driver_may_give_is_refused(reading: Reading, sentence: str) -> None:
    assert sentence in str(check()[1].fault(reading))


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"sensors": ()}, "0 sensors"),
        ({"sensors": ("A", "A")}, "more than once"),
        ({"sensors": ("A", "supply_v")}, "more than once"),
        ({"sensors": ("A B",)}, "not a channel name"),
        ({"sensors": tuple(f"S{i}" for i in range(1025))}, "1025 sensors"),
        ({"rate_hz": float("nan")}, "rate of nan"),
        ({"rate_hz": 0.0}, "rate of 0"),
    ],
)
def test_devices_that_describe_themselves_badly_are_refused(change: dict, sentence: str) -> None:
    device = SignalGenerator()
    for name, value in change.items():
        setattr(device, name, value)
    with pytest.raises(DeviceError, match=sentence):
        check_description(device)


def test_lost_device_is_opened_again_with_growing_pauses() -> None:
    device = SignalGenerator()
    reopening = ReopeningDevice(device)
    assert reopening.read(0.1) is not None
    device.unplugged.set()
    with pytest.raises(DeviceLost, match="unplugged"):
        reopening.read(0.1)
    tries = 0
    started = time.monotonic()
    while time.monotonic() - started < 0.8:
        try:
            assert reopening.read(0.01) is None
        except DeviceLost:
            tries += 1
    assert 1 <= tries <= 4
    device.unplugged.clear()

    def reads() -> bool:
        try:
            return reopening.read(0.01) is not None
        except DeviceLost:
            return False

    eventually(reads, "the device is read again")
    assert (reopening.openings, device.opened) == (2, 2)


def test_foreign_exceptions_of_a_device_count_as_a_loss() -> None:
    device = SignalGenerator()
    device.instead.append(ZeroDivisionError("in the driver"))
    with pytest.raises(DeviceLost, match="signal-generator: an unforeseen ZeroDivisionError"):
        ReopeningDevice(device).read(0.1)


@pytest.mark.parametrize("error", [DeviceFinished("end"), DeviceError("no baud rate works")])
def test_other_device_errors_come_as_they_are(error: DeviceError) -> None:
    device = SignalGenerator()
    device.instead.append(error)
    with pytest.raises(type(error), match=str(error)):
        ReopeningDevice(device).read(0.1)


def test_devices_are_found_by_name_and_near_names_are_suggested() -> None:
    assert {"replay", "cyberglove"} <= set(device_names())
    with pytest.raises(UnknownDevice, match="did you mean 'replay'"):
        build_device("reply:x")
    with pytest.raises(UnknownDevice, match=r"installed are .*replay"):
        build_device("zzzz")
    assert isinstance(SignalGenerator(), Device)
