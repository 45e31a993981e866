"""A take whose reference states a standard deviation for each angle: in memory and in tables."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from glovecal_models.errors import BadInput, BadTakeTable
from glovecal_models.takes.table import read_reference, read_takes
from glovecal_models.takes.take import Take
from glovecal_models.takes.write_table import write_takes


def take(rows: int = 6, **more) -> Take:
    time = 0.03 * np.arange(rows)
    reference = np.column_stack([10.0 * np.arange(rows), np.full(rows, 5.0)])
    return Take(
        "t", "w1", ("A", "B"), 0.01 * np.arange(3 * rows), np.arange(6.0 * rows).reshape(-1, 2), ("A", "B"),
        time, reference, **more,
    )  # fmt: skip


def test_deviations_are_read_at_the_frames_as_the_angles_are():
    deviations = np.column_stack([1.0 + np.arange(6), np.full(6, np.nan)])
    found = take(reference_sd=deviations).reference_sd_at_frames(["B", "A"])
    assert found is not None
    assert np.isnan(found[:, 0]).all()
    np.testing.assert_allclose(found[:7, 1], [1, 4 / 3, 5 / 3, 2, 7 / 3, 8 / 3, 3])
    assert take().reference_sd_at_frames(["A"]) is None


def test_nothing_is_drawn_across_an_angle_that_was_not_accepted():
    whole = take()
    reference, deviations = whole.reference.copy(), np.ones((6, 2))
    reference[3, 0] = deviations[3, 0] = np.nan
    seen = replace(whole, reference=reference, reference_sd=deviations).reference_at_frames(["A", "B"])
    usual = replace(whole, reference=reference).reference_at_frames(["A", "B"])
    np.testing.assert_array_equal(np.flatnonzero(np.isnan(seen[:16, 0])), [*range(7, 13)])
    assert not np.isnan(seen[:16, 1]).any()
    assert not np.isnan(usual[:16, 0]).any()  # as it was: markers that are missing for a moment


@pytest.mark.parametrize("wrong", [0.0, -1.0, np.nan, np.inf])
def test_a_deviation_that_cannot_be_is_refused_with_its_row(wrong):
    deviations = np.ones((6, 2))
    deviations[4, 1] = wrong
    with pytest.raises(BadInput, match=r"standard deviation of B is .* in row 5"):
        take(reference_sd=deviations)
    with pytest.raises(BadInput, match="reference_sd has shape"):
        take(reference_sd=np.ones((6, 1)))


@settings(max_examples=25)
@given(st.integers(0, 2**32 - 1), st.sampled_from([".csv", ".parquet"]), st.booleans())
def test_a_table_gives_back_what_was_written(tmp_path_factory, seed, suffix, own_clock):
    random = np.random.default_rng(seed)
    whole = take()
    rows = len(whole.reference_time_s) if own_clock else len(whole.time_s)
    angles = random.uniform(-90, 90, (rows, 2))
    known = random.random((rows, 2)) < 0.7
    known[0] = True
    deviations = np.where(known, random.uniform(0.1, 9, (rows, 2)), np.nan)
    if seed % 2:
        deviations[:, 1] = np.nan
    time = whole.reference_time_s + 0.001 if own_clock else whole.time_s
    written = replace(
        whole, reference_time_s=time, reference=np.where(known, angles, np.nan), reference_sd=deviations
    )
    plain = replace(written, name="plain", reference_sd=None)
    files = write_takes([written, plain], tmp_path_factory.mktemp("t") / f"x{suffix}")
    read, other = read_takes(files[0])
    np.testing.assert_array_equal(read.reference, written.reference)
    assert read.reference_sd is not None
    np.testing.assert_array_equal(read.reference_sd, deviations)
    assert other.reference_sd is None


def test_a_reference_table_may_state_deviations(tmp_path: Path):
    file = tmp_path / "r.csv"
    file.write_text("time_s,r.A,sd.A,r.B\n0,1,0.5,2\n1,,,3\n", encoding="utf-8")
    rows = read_reference(file)[None]
    assert rows.reference_sd is not None
    np.testing.assert_array_equal(rows.reference_sd, [[0.5, np.nan], [np.nan, np.nan]])


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("time_s,s.A,sd.A\n0,1,1\n", "there is no r.A beside it"),
        ("time_s,s.A,r.A,sd.A\n0,1,1,0\n", "impossible for a standard deviation"),
        ("time_s,s.A,r.A,sd.A\n0,1,1,1\n1,1,1,\n", "in all of its rows or in none"),
    ],
)
def test_what_is_wrong_with_a_column_of_deviations_is_said(tmp_path: Path, text: str, problem: str):
    (tmp_path / "t.csv").write_text(text, encoding="utf-8")
    with pytest.raises(BadTakeTable, match=problem) as caught:
        read_takes(tmp_path / "t.csv")
    assert "sd.A" in str(caught.value)
