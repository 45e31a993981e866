"""The kernels that were tried for each rotation, as rows of a table."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

KERNEL_COLUMNS = {
    "rotation": "rotation",
    "kernel": "kernel",
    "chosen": "chosen",
    "nlml": "NLML (nats)",
    "evidence_gain": "evidence gain (nats)",
    "held_out_rmse_deg": "error on takes left out (°)",
}


def kernel_rows(rotations: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """One row a candidate; before them what their errors are to be read against."""
    rows: list[dict[str, Any]] = []
    for rotation in rotations:
        found = rotation["kernel_choice"]
        if found is None:
            continue
        for words, error in (("always the mean", "spread_deg"), ("a straight line", "straight_line_deg")):
            rows.append(
                {"rotation": rotation["rotation"], "kernel": words, "held_out_rmse_deg": found[error]}
            )
        rows += [
            {
                **item,
                "rotation": rotation["rotation"],
                "kernel": item["words"],
                "chosen": item["chosen"] or None,
            }
            for item in found["candidates"]
        ]
    return rows
