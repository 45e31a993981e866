"""A reference of another computer finds its take and its place in it, or says that movement does not tell."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from foreign_tables import recording

from glovecal_models.errors import BadInput
from glovecal_models.takes.joined_reference import best_of, join_reference, join_references, with_reference
from glovecal_models.takes.table import ReferenceRows
from glovecal_models.takes.take import Take

NAMES = tuple("ABCDE")
LAG_S = 0.05
"""The play in the readings looks like a delay of some hundredths of a second."""


def recorded(number: int, *, from_s: float = 0.0) -> tuple[Take, ReferenceRows]:
    """A take without angles, and its angles by the same clock."""
    time_s, readings, angles = recording(number, 1, seconds=25.0)
    take = Take(f"t{number}", "w1", NAMES, time_s + from_s, readings)
    return take, ReferenceRows(time_s + from_s, NAMES, angles, None)


def later(rows: ReferenceRows, by_s: float, from_row: int = 0) -> ReferenceRows:
    """By another clock, and begun later."""
    return replace(rows, time_s=rows.time_s[from_row:] + by_s, reference=rows.reference[from_row:])


@pytest.mark.parametrize("begun_s", [0.0, 1.77e9])
@pytest.mark.parametrize("late_rows", [0, 300, 600])
@pytest.mark.parametrize("clock_s", [0.0, -0.31, 4000.0])
def test_the_offset_is_found_whatever_both_count(begun_s: float, late_rows: int, clock_s: float) -> None:
    take, rows = recorded(3, from_s=begun_s)
    found = join_reference(take, later(rows, clock_s, late_rows))
    assert found.is_matched
    assert found.offset_s == pytest.approx(clock_s, abs=LAG_S)
    assert found.unexplained < 0.15


def test_a_system_that_counts_from_its_own_start() -> None:
    take, rows = recorded(4)
    own = later(rows, 0.0, 438)
    found = join_reference(take, replace(own, time_s=own.time_s - own.time_s[0]))
    assert found.offset_s == pytest.approx(-7.3, abs=LAG_S)
    assert "begins 7.3" in found.sentence


def test_hidden_markers_hide_no_clock() -> None:
    take, rows = recorded(5)
    angles = rows.reference.copy()
    for column in range(5):
        angles[200 * column : 200 * column + 90, column] = np.nan
    found = join_reference(take, replace(later(rows, 2.0), reference=angles))
    assert found.offset_s == pytest.approx(2.0, abs=LAG_S)
    assert np.isnan(found.take.reference).sum() == 5 * 90


def test_each_take_gets_the_reference_that_fits_it() -> None:
    takes, rows = zip(*(recorded(number) for number in range(4)), strict=True)
    moved = [later(each, 50.0 * number) for number, each in enumerate(rows)]
    found = join_references(takes, [{None: each} for each in reversed(moved)])
    assert [each.offset_s for each in found] == pytest.approx([0.0, 50.0, 100.0, 150.0], abs=LAG_S)
    best, *others = best_of(takes, [moved[2]])
    assert best.take.name == "t2"
    assert not any(each.is_matched for each in others)


def test_what_movement_does_not_tell_is_said() -> None:
    take, _ = recorded(6)
    _, rows = recorded(7)
    found = join_reference(take, rows)
    assert not found.is_matched
    assert found.sentence == (
        "Movement does not tell whether it belongs to take t6; both are taken to count the same time."
    )
    with pytest.raises(BadInput, match="no row of the reference lies within take 't6'"):
        with_reference(take, rows, 900.0)
    with pytest.raises(BadInput, match="name it in the column take"):
        join_references([take, replace(take, name="other")], [{"t6": rows}])
