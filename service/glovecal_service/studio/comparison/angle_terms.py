"""One angle taken apart: what the base says and what each effect adds."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from nicegui import ui
from nicegui.elements.mixins.text_element import TextElement

from glovecal_service.studio.amounts import degrees

CHANGES_THE_ANGLE = ("base", "held", "correction")


def angle_terms(name: str, answer: Mapping[str, Any]) -> None:
    """An answer of ``POST /v1/models/{id}/explain`` for one rotation; ``name``: the model's short one."""
    [angle] = answer["rotations"]
    with ui.element("div").classes("table-box") as box:
        box.props('tabindex="0" role="region"')
        box.props["aria-label"] = f"Terms of the angle, {name}"
        with ui.element("table").classes("term-table"):
            TextElement(tag="caption", text=name)
            with ui.element("thead"), ui.element("tr"):
                for text in ("Term", "Degrees", "SD"):
                    TextElement(tag="th", text=text).props('scope="col"')
            with ui.element("tbody"):
                for number, term in enumerate(angle["terms"]):
                    changes = term["kind"] in CHANGES_THE_ANGLE
                    value = _signed(term["degrees"]) if number else degrees(term["degrees"])
                    sd = "not stored" if term["sd_deg"] is None else degrees(term["sd_deg"])
                    _row(term["name"], value if changes else "", sd)
                _row("predicted angle", degrees(angle["degrees"]), degrees(angle["sd_deg"]), is_sum=True)
    readings = ", ".join(f"{sensor} {value:g}" for sensor, value in angle["readings"].items())
    if readings:
        ui.label(f"Raw readings: {readings}.")
    for sentence in (*answer["sentences"], *angle["sentences"]):
        ui.label(sentence)


def _row(name: str, value: str, sd: str, *, is_sum: bool = False) -> None:
    with ui.element("tr").classes("term-sum" if is_sum else ""):
        TextElement(tag="th", text=name).props('scope="row"')
        TextElement(tag="td", text=value)
        TextElement(tag="td", text=sd)


def _signed(value: float) -> str:
    return f"{value:+.2f}°"
