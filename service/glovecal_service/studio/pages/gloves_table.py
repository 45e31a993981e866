"""Gloves that were seen, and the layouts that say what their sensors read."""

from __future__ import annotations

from urllib.parse import quote

from nicegui import ui

from glovecal_service.rest.glove.answer import Gloves, GloveView, LayoutView
from glovecal_service.studio.heading import heading, quiet_act
from glovecal_service.studio.service import Service, refusals
from glovecal_service.studio.table import table, text_row

GLOVE_HEADS = ("Glove", "Layout", "Hand", "Worn by", "Wearing", "Measured latency", "Delay", "Last seen", "")
LAYOUT_HEADS = ("Layout", "Sensors", "Rotations", "Of them read from several sensors", "Origin")


async def gloves_table(service: Service) -> None:
    """Two sections; the first only once a glove was seen."""
    found = await service.read(Gloves, "/gloves")
    if found.seen:
        with ui.element("section").classes("tree"):
            heading(2, "Gloves seen")
            with table("Gloves seen", GLOVE_HEADS):
                for glove in found.seen:
                    _glove(glove, service)
    with ui.element("section").classes("tree"):
        heading(2, "Layouts")
        ui.label("A layout says which sensors a glove has, and which of them read each rotation.")
        with table("Layouts", LAYOUT_HEADS):
            for layout in found.layouts:
                _layout(layout)


def _glove(glove: GloveView, service: Service) -> None:
    name = f"{glove.name} (simulated)" if glove.simulated else glove.name
    latency = glove.latency
    row = text_row(
        name,
        glove.layout or "–",
        glove.hand or "–",
        glove.subject or "nobody",
        glove.wearing or "–",
        "not measured"
        if latency is None
        else f"{1000 * latency.latency_s:.0f} ± {1000 * latency.sd_s:.0f} ms",
        f"{glove.delay_ms} ms" if glove.delay_ms else "live",
        f"{glove.last_seen_at.astimezone():%Y-%m-%d %H:%M}",
    )

    async def remove() -> None:
        with refusals():
            await service.delete(f"/gloves/{quote(glove.name)}")
            row.delete()

    with row, ui.element("td"):
        quiet_act("Remove", remove).props["aria-label"] = f"Remove glove {glove.name}"


def _layout(layout: LayoutView) -> None:
    text_row(
        layout.name,
        str(len(layout.sensors)),
        str(len(layout.rotations)),
        str(sum(len(sensors) > 1 for sensors in layout.read_from.values())),
        "built in" if layout.built_in else "stored here",
    )
