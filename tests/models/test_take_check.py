"""What a take's check says, against takes made with known faults."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from glovecal_models.takes.take import Take
from glovecal_models.takes.take_check import check_take


def take(frames: int = 200, rate_hz: float = 50.0, **changes) -> Take:
    rng = np.random.default_rng(0)
    time_s = np.arange(frames) / rate_hz
    readings = rng.integers(0, 256, (frames, 3)).astype(float)
    reference = np.column_stack([np.linspace(-10, 80, frames), np.full(frames, np.nan)])
    made = Take("fist", "w", ("A", "B", "C"), time_s, readings, ("R", "S"), time_s, reference)
    return dataclasses.replace(made, **changes)


def test_a_sound_take_has_no_sentence():
    found = check_take(take())
    assert found.rate_hz == pytest.approx(50.0)
    assert (found.gaps, found.frames_with_reference) == (0, 1.0)
    assert found.repeated_frames < 0.01
    assert [item.sensor for item in found.sensors] == ["A", "B", "C"]
    (measured,) = found.rotations
    assert (measured.rotation, measured.rows, measured.low_deg, measured.high_deg) == ("R", 200, -10, 80)
    assert found.sentences == ()


@given(st.sets(st.integers(1, 198), max_size=6))
def test_left_out_frames_are_counted(left_out: set[int]):
    """A gap is a run of left-out frames of two or more, or one: the interval is then twice the median."""
    whole = take()
    kept = [n for n in range(200) if n not in left_out and n - 1 not in left_out]  # two frames each
    part = dataclasses.replace(
        whole, time_s=whole.time_s[kept], readings=whole.readings[kept], rotations=(),
        reference_time_s=np.empty(0), reference=np.empty((0, 0)),
    )  # fmt: skip
    gaps = int((np.diff(kept) > 2).sum())
    found = check_take(part)
    assert found.gaps == gaps
    assert any("gap" in sentence for sentence in found.sentences) == bool(gaps)


def test_a_dead_sensor_and_a_slow_glove_are_named():
    readings = np.repeat(np.random.default_rng(1).integers(0, 256, (50, 3)), 4, axis=0).astype(float)
    readings[:, 1] = 87
    found = check_take(take(readings=readings))
    assert found.repeated_frames == pytest.approx(0.75, abs=0.02)
    assert found.sensors[1].changed == 0
    dead, slow = found.sentences
    assert "B (always 87)" in dead
    assert "75 %" in slow


def test_a_reference_on_another_clock_is_named():
    found = check_take(take(reference_time_s=take().time_s + 1e9))
    assert found.frames_with_reference == 0
    assert "clocks" in found.sentences[-1]


def test_one_frame_is_enough():
    found = check_take(Take("one", "w", ("A",), np.zeros(1), np.ones((1, 1))))
    assert (found.rate_hz, found.longest_interval_s, found.gaps) == (None, None, 0)
    assert found.sentences == ()
