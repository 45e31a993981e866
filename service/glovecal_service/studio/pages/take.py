"""One take: what was recorded, before anything else is made of it; another one over it."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from typing import Any
from urllib.parse import quote

from nicegui import ui

from glovecal_service.rest.take.answer import Take
from glovecal_service.studio.heading import heading
from glovecal_service.studio.pages.take_export import TakeExport
from glovecal_service.studio.pages.take_view import TakeView, add_take_styles
from glovecal_service.studio.service import Refusal
from glovecal_service.studio.shell import Around, page, shell
from glovecal_service.studio.studio import Studio


def add(studio: Studio) -> None:
    """``/studio/take``."""

    @page("/take")
    async def take(id: str = "", beside: str = "") -> None:
        async with shell(studio, "takes", "Take") as around:
            add_take_styles()
            await _build(studio, around, await around.chosen.takes(studio.service), id, beside)


async def _build(studio: Studio, around: Around, takes: Sequence[Take], id: str, over: str) -> None:
    own = next((take for take in takes if id and take.id.startswith(id)), None)
    if own is None and id:
        with suppress(Refusal):  # an old one
            own = await studio.service.read(Take, f"/takes/{quote(id)}")
    if own is None:
        ui.label(f"There is no take {id[:12]}." if id else "No take was chosen.").classes("studio-notice")
        ui.link("All takes", "/takes").classes("studio-link")
        return
    alike = [take for take in reversed(takes) if take.sensors == own.sensors]
    options = {take.id: take.line for take in (*alike, own)}
    others = {"": "none"} | {key: text for key, text in options.items() if key != own.id}
    over = over if over in others else ""
    view = TakeView(studio, own, around.chosen.model)
    heading(2, f"{own.subject}: {own.line}")
    with ui.row().classes("choices"):
        ui.select(options, value=own.id, label="Take", on_change=_go).classes("choice")
        ui.select(
            others, value=over, label="Over it", on_change=lambda event: view.show_over(event.value)
        ).classes("choice")
    await view.build(over)
    await TakeExport(studio, own, takes, view.posed_by).build()
    with ui.element("div").classes("page-acts"):
        ui.link("Download the recording as a table", f"../v1/takes/{own.id}/export").classes(
            "studio-link"
        ).props("download")
        ui.link("Train on takes", "/takes").classes("studio-link")


def _go(event: Any) -> None:
    ui.navigate.to(f"/take?id={quote(event.value)}")
