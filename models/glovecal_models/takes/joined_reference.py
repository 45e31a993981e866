"""A reference that was recorded by another computer, joined to the take it belongs to.

Where both count the same time nothing has to be found; else the take and the offset are wanted at which the
readings explain the angles best, over every overlap there can be. What movement cannot tell is said.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from glovecal_models.errors import BadInput
from glovecal_models.takes.clock_scan import (
    BETTER_THAN_REVERSED,
    LEAST_OVERLAP,
    ClockOffset,
    clock_offsets,
    on_grid,
    unexplained,
)
from glovecal_models.takes.table import ReferenceRows
from glovecal_models.takes.take import Take

SAME_CLOCK_OVERLAP = 0.5
"""Of the shorter of both: two recorders that count the same time cover so much of each other."""
WIDE_STEP_S = 0.1
MOST_STEPS = 3000
WIDE_EVERY = 5
"""Of the grid's rows, for the wide search."""
FILLED_FROM = 0.5
"""Share of rows in which a rotation was seen, from which on its gaps are bridged to find the clock."""
ReferencesByTake = Mapping[str | None, ReferenceRows]


@dataclass(frozen=True)
class JoinedReference:
    """A take with its reference, on the take's clock."""

    take: Take
    offset_s: float
    """Reference time = frame time + offset."""
    is_matched: bool
    """Whether movement tells that it belongs here, and when."""
    unexplained: float
    """Share of the angles' variance that no linear map of the readings explains; 1 where nobody can say."""
    sentence: str


def with_reference(take: Take, rows: ReferenceRows, offset_s: float) -> Take:
    """``offset_s``: reference time less frame time. Raises BadInput where not a row lies within the take."""
    whole = _with(take, rows, offset_s)
    time_s = whole.reference_time_s
    if not ((time_s >= take.start_s) & (time_s <= take.time_s[-1])).any():
        raise BadInput(
            f"no row of the reference lies within take {take.name!r}: on its clock it counts from "
            f"{time_s[0]:.1f} to {time_s[-1]:.1f} s, the take from {take.time_s[0]:.1f} to "
            f"{take.time_s[-1]:.1f} s; choose another take"
        )
    return whole


def join_reference(take: Take, rows: ReferenceRows) -> JoinedReference:
    """The reference where movement puts it; where that does not tell, by the time that both count, or else
    both begin at once."""
    first, last = float(rows.time_s[0]), float(rows.time_s[-1])
    together = min(last, take.time_s[-1]) - max(first, take.time_s[0])
    shares = together > SAME_CLOCK_OVERLAP * min(last - first, take.duration_s)
    start = 0.0 if shares else first - float(take.time_s[0])
    clock = _clock(take, rows, start)
    if not _is_matched(clock):  # the same seconds may have been counted from two moments
        widely = start + _widest(_filled(_with(take, rows, start)))
        elsewhere = _clock(take, rows, widely)
        if _is_matched(elsewhere):
            start, shares, clock = widely, False, elsewhere
    if clock.verdict == "offset":
        start += clock.offset_s
    is_matched = _is_matched(clock)
    return JoinedReference(
        with_reference(take, rows, start),
        start,
        is_matched,
        clock.unexplained_after if is_matched else 1.0,
        _sentence(take, rows, start, clock, shares),
    )


def join_references(takes: Sequence[Take], references: Sequence[ReferencesByTake]) -> list[JoinedReference]:
    """Each take with the reference that names it, else with the one that fits best. Raises BadInput where
    there is none for a take."""
    joined = []
    for take in takes:
        named = [each[take.name] for each in references if take.name in each]
        others = [rows for each in references for name, rows in each.items() if name is None]
        if not named and not others and len(takes) == len(references) == len(references[0]) == 1:
            others = list(references[0].values())
        if not named and not others:
            raise BadInput(f"no reference holds rows for take {take.name!r}; name it in the column take")
        joined.append(best_of([take], named or others)[0])
    return joined


def best_of(takes: Sequence[Take], references: Sequence[ReferenceRows]) -> list[JoinedReference]:
    """Every pair that has a moment in common, the best first. Raises BadInput where there is none."""
    joined, refused = (
        [],
        BadInput("there is no take that the reference could belong to; record or import one"),
    )
    for take in takes:
        for rows in references:
            try:
                joined.append(join_reference(take, rows))
            except BadInput as error:
                refused = error
    if not joined:
        raise refused
    return sorted(joined, key=lambda each: (not each.is_matched, each.unexplained))


def _clock(take: Take, rows: ReferenceRows, offset_s: float) -> ClockOffset:
    return clock_offsets([_filled(_with(take, rows, offset_s))])[0]


def _is_matched(clock: ClockOffset) -> bool:
    return clock.verdict in ("offset", "agrees")


def _with(take: Take, rows: ReferenceRows, offset_s: float) -> Take:
    return replace(
        take, rotations=rows.rotations, reference_time_s=rows.time_s - offset_s, reference=rows.reference,
        reference_sd=rows.reference_sd,
    )  # fmt: skip


def _filled(take: Take) -> Take:
    """With gaps bridged: a marker that was hidden for a moment hides no clock."""
    angles = take.reference.copy()
    for column in angles.T:
        known = np.isfinite(column)
        if FILLED_FROM <= known.mean() < 1.0:
            column[~known] = np.interp(np.flatnonzero(~known), np.flatnonzero(known), column[known])
    return replace(take, reference=angles)


def _widest(take: Take) -> float:
    """The offset with the best fit, of all at which both overlap enough, in steps of a tenth of a second.
    0 where readings played backwards fit nearly as well."""
    grid = on_grid(take)
    if grid is None:
        return 0.0
    grid = replace(grid, time_s=grid.time_s[::WIDE_EVERY], readings=grid.readings[::WIDE_EVERY])
    least = LEAST_OVERLAP * grid.most_overlap * take.duration_s
    low = float(take.reference_time_s[0] + least - take.time_s[-1])
    high = float(take.reference_time_s[-1] - least - take.time_s[0])
    steps = np.arange(low, high + WIDE_STEP_S, max(WIDE_STEP_S, (high - low) / MOST_STEPS))
    left, backwards = (
        np.array([unexplained(grid, readings, grid.time_s + step) for step in steps])
        for readings in (grid.readings, grid.readings[::-1])
    )
    if not (np.isfinite(left) & np.isfinite(backwards)).any():
        return 0.0
    if np.nanmin(left) > BETTER_THAN_REVERSED * np.nanmin(backwards):
        return 0.0
    return float(steps[np.nanargmin(left)])


def _sentence(take: Take, rows: ReferenceRows, offset_s: float, clock: ClockOffset, shares: bool) -> str:
    if not _is_matched(clock):
        both = "both are taken to count the same time" if shares else "both are taken to begin at once"
        return f"Movement does not tell whether it belongs to take {take.name}; {both}."
    explained = 100 * (1.0 - clock.unexplained_after)
    begins = float(rows.time_s[0]) - offset_s - float(take.time_s[0])
    when = (
        "at the same time" if abs(begins) < 0.005
        else f"{abs(begins):.2f} s {'after' if begins > 0 else 'before'} it"
    )  # fmt: skip
    return (
        f"It belongs to take {take.name} and begins {when}: the readings explain {explained:.0f} % of its "
        "movement."
    )
