"""The capture device ``simulated``: the client's device contract, its pace, its reference."""

from __future__ import annotations

import time

import numpy as np
import pytest

from glovecal_client.capture.device import Device, Reading, build_device
from glovecal_client.errors import BadOption, DeviceFinished, DeviceLost
from glovecal_models.takes.table import read_reference
from glovecal_service import simulated_device
from glovecal_service.simulated_device import SimulatedDevice, SimulationOptions


def read_all(device: Device) -> list[Reading]:
    """Every reading until the device has no more."""
    readings = []
    while True:
        try:
            reading = device.read(0.05)
        except DeviceFinished:
            return readings
        if reading is not None:
            readings.append(reading)


def played(device: SimulatedDevice) -> np.ndarray:
    """All readings of one opening, shape (N, S)."""
    device.open()
    return np.array([reading.readings for reading in read_all(device)])


def quick(**options: str) -> SimulatedDevice:
    """A fast device of 0.3 s, 60 frames."""
    return SimulatedDevice.from_options(None, {"rate_hz": "200", "duration": "0.3", **options})


def test_it_is_installed_and_says_what_it_gives_before_it_is_opened():
    device = build_device("simulated")
    assert isinstance(device, Device)
    assert device.simulated
    assert (device.layout, len(device.sensors), device.context) == ("cyberglove18", 18, ())
    assert device.rate_hz == 120
    with pytest.raises(DeviceLost, match="not open"):
        device.read(0.01)


def test_frames_come_when_they_are_due_on_an_absolute_schedule():
    device = quick()
    device.open()
    before = time.monotonic_ns()
    readings = read_all(device)
    assert len(readings) == 60
    stamps = np.array([reading.monotonic_ns for reading in readings])
    assert (np.diff(stamps) > 0).all()
    due = before + np.arange(60) * 1e9 / 200
    assert (stamps > due - 2e6).all()  # never early, so late frames are made up for and nothing drifts
    assert all(reading.readings.shape == (18,) for reading in readings)
    assert all(reading.readings.dtype == np.float32 for reading in readings)
    assert all((reading.readings >= 1).all() and (reading.readings <= 255).all() for reading in readings)


def test_nothing_is_read_before_its_time():
    device = SimulatedDevice.from_options(None, {"rate_hz": "1"})
    device.open()
    assert device.read(0.0) is not None
    assert device.read(0.01) is None
    device.close()


def test_frames_that_are_too_late_are_left_out_as_by_a_real_glove(monkeypatch):
    monkeypatch.setattr(simulated_device, "LATE_S", 0.05)
    device = quick()
    device.open()
    assert device.read(1.0) is not None
    time.sleep(0.2)
    assert len(read_all(device)) < 59 - 25  # 0.2 s slept, 0.05 s made up for: 30 frames lost


def test_the_same_seed_gives_the_same_readings_also_when_opened_again():
    first = quick()
    once = played(first)
    np.testing.assert_array_equal(once, played(first))
    np.testing.assert_array_equal(once, played(quick()))
    assert not np.array_equal(once, played(quick(seed="1")))


def test_another_wearing_is_the_same_glove_shifted():
    devices = [quick(motion="key_poses", wearing=wearing) for wearing in ("0", "1")]
    means = [played(device).mean(axis=0) for device in devices]
    assert not np.allclose(means[0], means[1], atol=0.2)
    np.testing.assert_allclose(means[0], means[1], atol=15)


def test_the_reference_table_has_a_row_for_each_frame_at_the_frame_time(tmp_path):
    path = tmp_path / "evaluation.reference.csv"
    device = quick(motion="evaluation", reference=str(path), layout="cyberglove22")
    device.open()
    readings = read_all(device)
    on_disk = path.read_text()  # before close: rows are written one by one
    device.close()
    assert on_disk == path.read_text()
    rows = read_reference(path)[None]
    np.testing.assert_array_equal(rows.time_s, np.array([r.monotonic_ns for r in readings]) / 1e9)
    assert len(rows.rotations) == 22
    assert "PALM_ARCH" not in rows.rotations
    assert set(rows.poses or ()) == {"flat"}
    assert 0.3 < np.diff(rows.reference, axis=0).std() < 2.0  # noisy, as measurements are
    with pytest.raises(BadOption, match="exists already"):
        quick(reference=str(path))


def test_a_reference_without_noise_is_the_truth(tmp_path):
    path = tmp_path / "held.reference.csv"
    device = quick(motion="evaluation", reference=str(path), reference_noise_deg="0")
    device.open()
    read_all(device)
    device.close()
    held = read_reference(path)[None].reference
    assert np.diff(held, axis=0).std() < 0.2  # the hand is still; what moves is rounding and tremor


def test_a_motion_ends_when_it_was_done_and_repeats_to_fill_a_duration():
    once = SimulatedDevice.from_options(None, {"motion": "wrist", "rate_hz": "10"})
    assert sum(1 for _ in once._simulate()) == 40
    longer = SimulatedDevice.from_options(None, {"motion": "wrist", "rate_hz": "10", "duration": "100"})
    frames = list(longer._simulate())
    assert len(frames) == 1000
    assert [frame.number for frame in frames] == list(range(1000))


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"speed": "2"}, "no option 'speed'; there are seed=N"),
        ({"motion": "dance"}, "must be one of free, key_poses"),
        ({"layout": "lucidglove"}, "must be one of cyberglove18, cyberglove22"),
        ({"seed": "1.5"}, "must be a whole number"),
        ({"seed": "-1"}, "from 0"),
        ({"rate_hz": "nan"}, "must be a number from 1 to 1000"),
        ({"rate_hz": "1e9"}, "must be a number from 1 to 1000"),
        ({"duration": "soon"}, "must be a number"),
        ({"reference_noise_deg": "-1"}, "from 0"),
        ({"reference": "/no/such/folder/r.csv"}, "there is no folder"),
    ],
)
def test_options_that_cannot_be_used_are_named(options, words):
    with pytest.raises(BadOption, match=words):
        SimulatedDevice.from_options(None, options)


def test_an_argument_is_refused():
    with pytest.raises(BadOption, match="takes no argument"):
        SimulatedDevice.from_options("free", {})


def test_options_have_defaults():
    assert SimulationOptions.parse({}) == SimulationOptions()
