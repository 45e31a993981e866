"""What the rest of a study costs, and how the time that is left is shared among its parts."""

from __future__ import annotations

from collections.abc import Sequence


def share_of_time(left_s: float, costs_s: Sequence[float]) -> float:
    """Seconds for the first of the parts that are still to come: as much of each gets done as of the others.

    ``costs_s``: what all that is missing costs in each. A part that needs less leaves the rest to the others.
    """
    whole = sum(costs_s)
    return max(left_s, 0.0) * (costs_s[0] / whole if whole > 0 else 1.0)


def estimate(costs_s: Sequence[float], workers: int) -> str:
    """A sentence. ``costs_s``: seconds of one processor for what is missing of each part."""
    hours = sum(costs_s) / 3600
    processes = f"{workers} processes" if workers > 1 else "one process"
    return f"about {_hours(hours)} of processor time, {_hours(hours / workers)} with {processes}"


def _hours(hours: float) -> str:
    return f"{hours:.1f} h" if hours >= 1 else f"{60 * hours:.0f} min"
