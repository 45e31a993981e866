"""Angles in radians and times in other units are told; what is impossible is refused; the rest is quiet."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from glovecal_models.errors import BadTakeTable
from glovecal_models.takes.table import read_takes
from glovecal_models.takes.take import Take
from glovecal_models.takes.take_check import check_take, take_warnings


def take(angle: np.ndarray, reading: np.ndarray, rate_hz: float = 60.0, name: str = "t") -> Take:
    time_s = np.arange(len(angle)) / rate_hz
    return Take(name, "w", ("I_PIP",), time_s, reading[:, None], ("I_PIP",), time_s, angle[:, None])


def moving(degrees: float, *, rest: float = 60.0, counts: float = 1.2, seed: int = 0) -> Take:
    """A finger that bends by ``degrees`` and a sensor of ``counts`` per degree, 10 s at 60 Hz."""
    random = np.random.default_rng(seed)
    angle = degrees * (0.5 - 0.5 * np.cos(np.arange(600) / 60)) + 0.1 * random.normal(size=600)
    return take(angle, np.round(rest + counts * angle + 0.5 * random.normal(size=600)))


def in_radians(take: Take) -> Take:
    return dataclasses.replace(take, reference=np.radians(take.reference))


def test_radians_are_told_with_the_sensor_that_moves():
    [sentence] = check_take(in_radians(moving(80))).sentences
    assert sentence.startswith("Take 't': no reference angle spans more than 1.3")
    assert "sensor I_PIP moves by 61 % of its largest reading: these look like radians" in sentence
    assert "multiply by 57.2958" in sentence


@settings(max_examples=60)
@given(st.floats(0.0, 2.5), st.sampled_from([60.0, 500.0, 3000.0]), st.integers(0, 1000))
def test_a_small_motion_in_degrees_is_not_told(degrees: float, rest: float, seed: int):
    sentences = check_take(moving(degrees, rest=rest, counts=rest / 100, seed=seed)).sentences
    assert not [text for text in sentences if "radians" in text]


def test_a_hand_held_still_before_tared_sensors_is_not_told():
    random = np.random.default_rng(3)
    still = take(0.3 * random.normal(size=600), random.normal(size=600))
    assert not check_take(still).sentences


def test_names_of_poses_as_numbers_are_not_radians():
    label = np.repeat([0.0, 1.0, 2.0, 3.0], 150)
    assert not check_take(take(label, 60 + 30 * label + np.arange(600) % 2)).sentences


@pytest.mark.parametrize(
    ("rate_hz", "unit"),
    [
        (0.12, "milliseconds (120 Hz), divide by 1e3"),
        (120e-6, "microseconds"),
        (120e-9, "nanoseconds (120 Hz), divide by 1e9"),
    ],
)
def test_times_in_another_unit_are_told_with_the_unit(rate_hz: float, unit: str):
    finger = moving(80)
    [sentence] = check_take(take(finger.reference[:, 0], finger.readings[:, 0], rate_hz)).sentences
    assert "time_s is wanted in seconds; if it is in " + unit in sentence


def test_times_in_days_are_told():
    finger = moving(80)
    [sentence] = check_take(take(finger.reference[:, 0], finger.readings[:, 0], 120 * 86400)).sentences
    assert "frames a second. time_s is wanted in seconds" in sentence


@pytest.mark.parametrize("origin", [0.0, -500.0, 1.7638e9, 6.37e10])
def test_any_origin_and_a_large_rotation_are_legitimate(tmp_path, origin: float):
    rows = "".join(f"{origin + n / 100:.2f},{60 + n},{190 - n}\n" for n in range(50))
    (tmp_path / "t.csv").write_text("time_s,s.A,r.R\n" + rows)
    [read] = read_takes(tmp_path / "t.csv")
    assert not check_take(read).sentences


def test_like_warnings_are_one_line_with_a_count():
    takes = [dataclasses.replace(in_radians(moving(80 + n)), name=f"t{n}") for n in range(4)]
    [sentence] = take_warnings(takes)
    assert sentence.startswith("Take 't0'")
    assert sentence.endswith("The same in 3 more takes.")


wild = st.one_of(
    st.floats(allow_nan=False, allow_infinity=False),
    st.sampled_from([1e300, -1e300, 12000.0, 361.0, 360.0, 3.5e38, 3.4e38, 1e11, 1.8e18, 5e-324]),
    st.floats(-400, 400),
)


@settings(max_examples=150)
@given(st.lists(st.tuples(wild, wild, wild), min_size=1, max_size=8, unique_by=lambda row: row[0]))
def test_any_finite_numbers_are_refused_with_their_place_or_can_be_checked(tmp_path_factory, rows):
    path = tmp_path_factory.mktemp("wild") / "t.csv"
    rows = sorted(rows)
    path.write_text("time_s,s.A,r.R\n" + "".join(f"{t!r},{s!r},{r!r}\n" for t, s, r in rows))
    refused = _refusal(path)
    if refused is not None:
        assert refused.file == "t.csv"
        assert refused.line is not None
        column = ["time_s", "s.A", "r.R"].index(str(refused.column))
        assert float(str(refused.value)) == rows[refused.line - 2][column]
        return
    [read] = read_takes(path)
    found = check_take(read)
    assert max(abs(item.high_deg) for item in found.rotations) <= 360.0
    assert all(math.isfinite(float(np.float32(item.high))) for item in found.sensors)
    assert read.duration_s <= 366 * 86400


def _refusal(path: Path) -> BadTakeTable | None:
    try:
        read_takes(path)
    except BadTakeTable as error:
        return error
    return None
