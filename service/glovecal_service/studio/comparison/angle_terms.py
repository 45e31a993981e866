"""One angle taken apart: what the base says and what each effect adds."""

from __future__ import annotations

from nicegui import ui

from glovecal_models.calibration.answer import Explanation
from glovecal_service.studio.amounts import degrees
from glovecal_service.studio.table import table, text_row


def angle_terms(name: str, answer: Explanation) -> None:
    """An answer of ``POST /v1/models/{id}/explain`` for one rotation; ``name``: the model's short one."""
    [angle] = answer.rotations
    with table(f"Terms of the angle, {name}", ("Term", "Degrees", "SD"), "term-table", caption=name):
        for number, term in enumerate(angle.terms):
            value = f"{term.degrees:+.2f}°" if number else degrees(term.degrees)
            sd = "not stored" if term.sd_deg is None else degrees(term.sd_deg)
            text_row(term.name, value if term.changes_the_angle else "", sd)
        text_row("predicted angle", degrees(angle.degrees), degrees(angle.sd_deg)).classes("term-sum")
    readings = ", ".join(f"{sensor} {value:g}" for sensor, value in angle.readings.items())
    if readings:
        ui.label(f"Raw readings: {readings}.")
    for sentence in (*answer.sentences, *angle.sentences):
        ui.label(sentence)
