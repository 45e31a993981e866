"""Effects: the catalogue of physical causes, each explained in a sentence or two."""

from __future__ import annotations

from urllib.parse import quote

from nicegui import ui

from glovecal_service.studio.heading import heading
from glovecal_service.studio.shell import shell
from glovecal_service.studio.studio import Studio


def add(studio: Studio) -> None:
    """``/studio/effects``."""

    @ui.page("/effects")
    async def effects() -> None:
        with shell(studio, "effects", "Effects"):
            found = await studio.service.get("/effects")
            with ui.element("div").classes("cards"):
                for effect in found:
                    with ui.element("section").classes("card").props() as section:
                        section.props["id"] = quote(effect["name"])
                        heading(2, effect["name"])
                        ui.label(effect["explanation"])
