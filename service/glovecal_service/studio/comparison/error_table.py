"""Errors of each rotation as heat: against the noise floor, the black-box ceiling and the baseline."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

from nicegui import ui

from glovecal_service.studio.amounts import degrees
from glovecal_service.studio.table import cell, table

OVERALL = "all rotations"
COOL_TIMES, HOT_TIMES = 1.0, 5.0
"""Times the noise floor at which a cell has no colour, and all of it."""
HOTTEST_PERCENT = 45
"""More of the colour, and the text on it would be hard to read."""

SCALE = (
    "Root mean square error in degrees, predicted against measured. Colour: the error over its noise floor, "
    "from none at the floor to full at five times the floor. Noise floor: how small an error can get on "
    "these takes. Ceiling: the error that a black box on everything recorded leaves. Baseline: the error of "
    "always answering the mean angle."
)


def error_table(
    comparisons: Sequence[tuple[str, Mapping[str, Any]]], chosen: str, choose: Callable[[str], Any]
) -> None:
    """``comparisons``: short name and answer of ``POST /v1/models/{id}/compare``; the first one's floor,
    ceiling and baseline stand beside, and its worst rotation first."""
    _, first = comparisons[0]
    ceiling = (first["ceiling"] or {}).get("rotations", {})
    overall = (first["ceiling"] or {}).get("overall")
    heads = ("Rotation", *(f"Error, {name}" for name, _ in comparisons), "Noise floor", "Ceiling", "Baseline")
    with table("Error of each rotation", heads, "error-table"):
        _row(OVERALL, [one["overall"] for _, one in comparisons], overall, None, choose)
        for name in sorted(first["rotations"], key=lambda name: -(_rmse(first, name) or 0.0)):
            errors = [one["rotations"].get(name) for _, one in comparisons]
            _row(name, errors, ceiling.get(name), chosen == name, choose)
    floors = [one["floor"] for one in first["rotations"].values() if one["floor"] is not None]
    doubted = [floor for floor in floors if not floor["is_reliable"]]
    if doubted:
        reasons = dict.fromkeys(reason for floor in doubted for reason in floor["reasons"])
        ui.label(
            f"* {len(doubted)} of {len(floors)} noise floors are not reliable: {'; '.join(reasons)}."
        ).classes("compare-scale")


def worst_rotation(comparison: Mapping[str, Any]) -> str:
    """That with the largest error."""
    return max(comparison["rotations"], key=lambda name: _rmse(comparison, name) or 0.0)


def _rmse(comparison: Mapping[str, Any], rotation: str) -> float | None:
    return comparison["rotations"][rotation]["rmse_deg"]


def _row(
    name: str,
    errors: Sequence[Mapping[str, Any] | None],
    ceiling: Mapping[str, Any] | None,
    is_chosen: bool | None,
    choose: Callable[[str], Any],
) -> None:
    """``is_chosen`` None: a row that cannot be chosen."""
    with ui.element("tr") as row:
        row.props["data-rotation"] = name
        with ui.element("th").props('scope="row"'):
            if is_chosen is None:
                ui.label(name)
            else:
                button = ui.element("button").classes("rotation-button").props('type="button"')
                button.props["aria-pressed"] = "true" if is_chosen else "false"
                button.on("click", partial(choose, name))
                with button:
                    ui.label(name)
        for one in errors:
            _error_cell(one)
        known = next((one for one in errors if one is not None), None)
        floor = None if known is None else known["floor"]
        cell(_floor(floor))
        cell("–" if ceiling is None else degrees(ceiling["ceiling_deg"]))
        cell("–" if known is None else degrees(known["baseline_deg"]))


def _error_cell(one: Mapping[str, Any] | None) -> None:
    if one is None:
        cell("–")
        return
    floor = one["floor"]
    times = None if floor is None or not floor["floor_deg"] else one["rmse_deg"] / floor["floor_deg"]
    with ui.element("td").classes("error-cell") as heat:
        if times is not None:
            share = min(1.0, max(0.0, (times - COOL_TIMES) / (HOT_TIMES - COOL_TIMES)))
            heat.style(f"--heat: {HOTTEST_PERCENT * share:.0f}%")
        ui.label(degrees(one["rmse_deg"])).classes("error-value")
        if times is not None:
            ui.label(f"{times:.1f} × floor").classes("error-times")


def _floor(floor: Mapping[str, Any] | None) -> str:
    if floor is None:
        return "–"
    least = "at least " if floor["is_lower_bound"] else ""
    doubt = "" if floor["is_reliable"] else " *"
    return f"{least}{degrees(floor['floor_deg'])}{doubt}"
