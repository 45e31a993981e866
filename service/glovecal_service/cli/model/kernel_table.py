"""The kernels that were tried for each rotation, as rows of a table."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

KERNEL_COLUMNS = {
    "rotation": "rotation",
    "kernel": "kernel",
    "chosen": "chosen",
    "held_out_rmse_deg": "error (°)",
    "nlml": "NLML (nats)",
    "evidence_gain": "evidence (nats)",
}
SCALE = (("mean angle", "spread_deg"), ("straight line", "straight_line_deg"))
"""What the candidates' errors are to be read against."""


def kernel_rows(rotations: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """One row a candidate, after those of the scale."""
    rows: list[dict[str, Any]] = []
    for rotation in rotations:
        found, name = rotation["kernel_choice"], {"rotation": rotation["rotation"]}
        if found is None:
            continue
        rows += [{**name, "kernel": words, "held_out_rmse_deg": found[error]} for words, error in SCALE]
        rows += [{**item, **name, "chosen": item["chosen"] or None} for item in found["candidates"]]
    return rows
