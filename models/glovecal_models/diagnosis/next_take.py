"""The next take that would decide between rivals, with seconds and instructions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

FAST = "fast"
RAMPS = "ramps"
ONE_FINGER = "one_finger"
CROSSED = "crossed"
SHUFFLED = "shuffled"
MORE_WEARINGS = "more_wearings"
MORE_TAKES = "more_takes"


@dataclass(frozen=True)
class NextTake:
    """A recording to make, and what it separates."""

    motion: str
    what: str
    seconds: int
    separates: tuple[str, ...]
    """Effects; "chance" where the takes are too few to tell an effect from it."""


_INSTRUCTIONS: dict[str, tuple[str, int]] = {
    FAST: (
        "Swing several fingers to and fro as fast as you comfortably can, 2 to 3.5 times a second, about 25"
        " degrees wide.",
        25,
    ),
    RAMPS: (
        "Close and open the hand slowly, turning back half-way now and then; once at 10, once at 40 degrees a"
        " second; then hold the fist for 20 s.",
        40,
    ),
    ONE_FINGER: (
        "Rest the hand on a table and move one finger after another while the others lie still.",
        30,
    ),
    SHUFFLED: (
        "Set the same angles once more, in another order, without touching the mounting.",
        60,
    ),
    CROSSED: (
        "Change one thing at a time: put in a fresh battery without switching off, take the glove off and on"
        " without switching off, switch off and on without taking it off; 40 s of free motion after each.",
        120,
    ),
}
_RELATED: tuple[tuple[frozenset[str], str], ...] = (
    (frozenset({"lag", "clock_offset"}), FAST),
    (frozenset({"hysteresis", "lag"}), FAST),
    (frozenset({"creep", "lag"}), FAST),
    (frozenset({"creep", "clock_offset"}), FAST),
    (frozenset({"hysteresis", "clock_offset"}), FAST),
    (frozenset({"hysteresis", "creep"}), RAMPS),
    (frozenset({"cross_coupling", "palm_arch"}), ONE_FINGER),
    (frozenset({"cross_coupling", "contact_pressure"}), ONE_FINGER),
    (frozenset({"nonlinearity", "saturation"}), RAMPS),
    (frozenset({"nonlinearity", "sensor_fault"}), SHUFFLED),
)
_SESSION = frozenset(
    {"warmup_drift", "temperature", "humidity", "supply_sag", "donning_shift", "garment_slip"}
)


def next_take(rivals: Sequence[str]) -> NextTake | None:
    """For the members of a confidence set, the best first; None when nothing is to be decided."""
    if len(rivals) < 2:
        return None
    for pair, motion in _RELATED:
        if pair <= set(rivals):
            return _take(motion, rivals)
    if len(_SESSION & set(rivals)) > 1:
        return _take(CROSSED, rivals)
    return _take(FAST, rivals)


def _take(motion: str, rivals: Sequence[str]) -> NextTake:
    what, seconds = _INSTRUCTIONS[motion]
    return NextTake(motion, what, seconds, tuple(rivals))
