"""One angle taken apart: what the base says and what each effect adds."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from nicegui import ui

from glovecal_service.studio.amounts import degrees
from glovecal_service.studio.table import table, text_row

CHANGES_THE_ANGLE = ("base", "held", "correction")


def angle_terms(name: str, answer: Mapping[str, Any]) -> None:
    """An answer of ``POST /v1/models/{id}/explain`` for one rotation; ``name``: the model's short one."""
    [angle] = answer["rotations"]
    with table(f"Terms of the angle, {name}", ("Term", "Degrees", "SD"), "term-table", caption=name):
        for number, term in enumerate(angle["terms"]):
            changes = term["kind"] in CHANGES_THE_ANGLE
            value = _signed(term["degrees"]) if number else degrees(term["degrees"])
            sd = "not stored" if term["sd_deg"] is None else degrees(term["sd_deg"])
            text_row(term["name"], value if changes else "", sd)
        text_row("predicted angle", degrees(angle["degrees"]), degrees(angle["sd_deg"])).classes("term-sum")
    readings = ", ".join(f"{sensor} {value:g}" for sensor, value in angle["readings"].items())
    if readings:
        ui.label(f"Raw readings: {readings}.")
    for sentence in (*answer["sentences"], *angle["sentences"]):
        ui.label(sentence)


def _signed(value: float) -> str:
    return f"{value:+.2f}°"
