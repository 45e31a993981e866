"""How readings drift within held poses, as a table of a page."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from glovecal_service.report.html import table

HEADS = ("pose", "sensor", "holds", "seconds each", "change, % of span", "same sign in", "time constant, s")


def hold_table(held: Mapping[str, Any]) -> str:
    """HTML of the ``hold_drift`` of a diagnosis or an improvement."""
    rows = [
        (
            pose["pose"],
            name,
            str(pose["holds"]),
            f"{pose['duration_s']:.0f}",
            f"{drift['change_pct']:+.1f}",
            str(drift["same_sign_holds"]),
            _time_constant(pose),
        )
        for pose in held["poses"]
        for name, drift in pose["sensors"].items()
    ]
    return table(HEADS, rows)


def _time_constant(pose: Mapping[str, Any]) -> str:
    return f"> {pose['duration_s']:.0f}" if pose["tau_is_lower_bound"] else f"{pose['tau_s']:.2g}"
