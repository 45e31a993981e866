"""Errors of fingertips on the terminal."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from glovecal_service.cli.terminal.printing import err, out, print_table

COLUMNS = {
    "finger": "fingertip (mm)",
    "rmse_mm": "RMSE",
    "floor": "floor",
    "percentile_95_mm": "95 %",
    "baseline_mm": "spread",
    "count": "frames",
}
LEGEND = (
    "Millimetres, seen from the palm. floor: the joints' noise floors carried to the tip, with their 95 % "
    "intervals (> for a lower bound); spread: the error of always answering the mean angles; thumb to index: "
    "of the distance between these two tips."
)


def print_fingertips(found: dict[str, Any] | None, subject: str) -> None:
    """The table and the sentence of one model; nothing for a layout that is no hand."""
    if found is None:
        return
    out.print("")
    rows = [{**row, "floor": _interval(row["floor"])} for row in _rows(found)]
    print_table(rows, COLUMNS, empty="")
    err.print(LEGEND)
    err.print(found["sentence"])
    if found["is_assumed"]:
        err.print(f"For {subject}'s own hand: glovecal subject measure {subject} --hand-length-mm LENGTH")


def print_fingertips_beside(models: Mapping[str, dict[str, Any] | None], headings: Mapping[str, str]) -> None:
    """RMSE of several models, a row a finger, between the smallest of their floors and no model at all."""
    known = {name: {row["finger"]: row for row in _rows(one)} for name, one in models.items() if one}
    rows = []
    for finger in dict.fromkeys(finger for of_model in known.values() for finger in of_model):
        errors = {name: of_model[finger] for name, of_model in known.items() if finger in of_model}
        floors = [one["floor"] for one in errors.values() if one["floor"] is not None]
        least = min(floors, key=lambda one: (one["is_lower_bound"], one["floor_mm"]), default=None)
        spread = next(iter(errors.values()))["baseline_mm"]
        rmse = {name: one["rmse_mm"] for name, one in errors.items()}
        rows.append({"finger": finger, **rmse, "floor": _interval(least), "spread": spread})
    if rows:
        out.print("")
        columns = {"finger": "fingertip RMSE (mm)", **headings, "floor": "floor", "spread": "spread"}
        print_table(rows, columns, empty="")


def _rows(found: dict[str, Any]) -> list[dict[str, Any]]:
    rows = {"all": found["overall"], **found["fingers"]}
    if found["thumb_index"] is not None:
        rows["thumb to index"] = found["thumb_index"]
    return [{"finger": finger, **errors} for finger, errors in rows.items()]


def _interval(floor: dict[str, Any] | None) -> str | None:
    if floor is None:
        return None
    if floor["is_lower_bound"]:
        return f">{floor['floor_mm']:.2f}"
    return f"{floor['low_mm']:.2f}-{floor['high_mm']:.2f}"
