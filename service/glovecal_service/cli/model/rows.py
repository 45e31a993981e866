"""A model's effects and the kernels that were tried, as rows of tables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

MOST_NUMBERS = 8
"""A donning shift has two for each wearing; the rest is counted, and in --json."""
EFFECT_COLUMNS = {
    "effect": "effect",
    "rotation": "rotation",
    "numbers": "learned",
    "evidence": "when it was added",
}
KERNEL_COLUMNS = {
    "rotation": "rotation",
    "kernel": "kernel",
    "chosen": "chosen",
    "held_out_rmse_deg": "error (°)",
    "nlml": "NLML (nats)",
    "evidence_gain": "evidence (nats)",
}
LINE_COLUMNS = {
    "rotation": "rotation",
    "sensor": "sensor",
    "scale": "scale (°/count)",
    "offset": "offset (°)",
}
SCALE = (("mean angle", "spread_deg"), ("straight line", "straight_line_deg"))
"""What the candidates' errors are to be read against."""


def effect_rows(effects: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """From the ``effect_details`` of a model document."""
    return [
        {
            "effect": effect["effect"] if first else "",
            "rotation": rotation,
            "numbers": _numbers(effect["parameters"].get(rotation, {})),
            "evidence": effect["evidence"] if first else "",
        }
        for effect in effects
        for first, rotation in _marked(effect["rotations"])
    ]


def _marked(rotations: Sequence[str]) -> list[tuple[bool, str]]:
    """Whether it is the first; an effect on no rotation still has a row."""
    return [(place == 0, name) for place, name in enumerate(rotations or [""])]


def _numbers(values: Mapping[str, float | None]) -> str:
    shown = [
        f"{name} {'?' if value is None else format(value, '.3g')}"
        for name, value in list(values.items())[:MOST_NUMBERS]
    ]
    more = len(values) - len(shown)
    return ", ".join(shown) + (f" and {more} more" if more > 0 else "")


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


def line_rows(rotations: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """One row for each reading of a linear rotation, the offset in its first."""
    return [
        {
            "rotation": "" if place else rotation["rotation"],
            "sensor": sensor,
            "scale": f"{scale:.4g}",
            "offset": "" if place else f"{rotation['line']['offset_deg']:.1f}",
        }
        for rotation in rotations
        if rotation["line"]
        for place, (sensor, scale) in enumerate(rotation["line"]["scale_deg"].items())
    ]
