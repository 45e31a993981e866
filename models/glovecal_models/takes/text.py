"""What is said about takes and their clocks."""

from __future__ import annotations

import math

import numpy as np

from glovecal_models.takes.hand_clocks import HandAlignment, How, TakeClock
from glovecal_models.takes.session_drift import SessionDrift

HOW: dict[How, str] = {
    "one computer": "one computer captured both, so they have one clock",
    "timecode": "both gloves follow one time code",
    "claps": "from claps that both gloves felt",
    "wall clocks": "two computers, compared by their wall clocks, which network time sets: record a clap",
    "assumed": "nobody measured it; taken as one clock. Record a clap, or capture both live",
}


def alignment_sentence(found: HandAlignment, clocks: tuple[TakeClock, TakeClock]) -> str:
    """Shift, its standard deviation, how it is known, and how far the gloves' own clocks drift."""
    sd = "" if math.isnan(found.sd_s) else f", standard deviation {1e3 * found.sd_s:.1f} ms"
    told = [f"The second take is shifted by {found.shift_s:+.4f} s{sd}: {HOW[found.how]}."]
    drifts = [1e6 * clock.drift for clock in clocks if clock.own is not None]
    if len(drifts) == 2:
        apart = drifts[1] - drifts[0]
        told.append(
            f"The gloves' own clocks drift by {drifts[0]:+.1f} and {drifts[1]:+.1f} ppm against the "
            f"computer's, {abs(apart) * 3.6:.0f} ms an hour from each other."
        )
    return " ".join(told)


MOST_NAMED = 3


def drift_sentence(found: SessionDrift) -> str:
    """How far readings, or angles where a model is known, have moved from start to end."""
    over = f"over {len(found.shapes)} shapes"
    if found.rms_deg is None:
        largest = np.argsort(np.abs(found.common_counts))[::-1][:MOST_NAMED]
        named = ", ".join(f"{found.sensors[at]} {found.common_counts[at]:+.1f}" for at in largest)
        return (
            f"Drift from start to end {over}: most in {named} counts (mean). No model is active: no angles."
            f"{_left_out(found)}"
        )
    largest = np.argsort(np.abs(found.common_deg))[::-1][:MOST_NAMED]
    named = ", ".join(f"{found.rotations[at]} {found.common_deg[at]:+.1f}" for at in largest)
    return (
        f"Drift from start to end: {found.rms_deg:.1f} degrees RMS {over}; most in {named} degrees (mean)."
        f"{_left_out(found)}"
    )


def _left_out(found: SessionDrift) -> str:
    return "".join(f" Left out: {name}, {why}." for name, why in found.left_out.items())
