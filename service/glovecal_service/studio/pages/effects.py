"""Effects: the catalogue of physical causes, each explained and drawn; and an effect of the user's own."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from urllib.parse import quote

from nicegui import ui

from glovecal_service.rest.effect.answer import CatalogueEffect, SchematicView
from glovecal_service.studio.findings.schematic_view import schematic_view
from glovecal_service.studio.heading import heading
from glovecal_service.studio.pages.own_expression import OwnExpression
from glovecal_service.studio.repeating import soon
from glovecal_service.studio.service import Refusal, Service
from glovecal_service.studio.shell import page, shell
from glovecal_service.studio.studio import Studio

WHAT_IT_DOES = {
    "correction": "Added to a model it corrects the predicted angles.",
    "repair": "Added to a model it mends the recorded reference before anything is learned.",
    "interval": "Added to a model it widens the claimed standard deviation; angles stay.",
    "finding": "It is found in a recording and shown; nothing corrects it.",
    "nothing": "It is what every other effect is held against.",
}


def add(studio: Studio) -> None:
    """``/studio/effects``."""

    @page("/effects")
    async def effects() -> None:
        async with shell(studio, "effects", "Effects", about_models=True) as around:
            ui.add_head_html('<link rel="stylesheet" href="/studio/static/findings.css">')
            found = await studio.service.read(list[CatalogueEffect], "/effects")
            pictures = []
            ui.label("Dashed: without the effect. Solid: with it. Shapes are real, sizes exaggerated.")
            ui.link("Write an effect of your own", "#own").classes("studio-link own-link")
            with ui.element("div").classes("cards"):
                for effect in found:
                    with ui.element("section").classes("card").props() as section:
                        section.props["id"] = quote(effect.name)
                        heading(2, effect.name)
                        ui.label(effect.explanation)
                        ui.label(_second_sentence(effect)).classes("effect-kind")
                        pictures.append((effect.name, ui.element("div").classes("schematic-place")))
            with ui.element("section").props('id="own"').classes("finding own-effect"):
                heading(2, "An effect of your own")
                if model := await around.model(studio.service):
                    await OwnExpression(studio, model.id).build()
            soon(partial(_draw, studio.service, pictures))


def _second_sentence(effect: CatalogueEffect) -> str:
    told = WHAT_IT_DOES[effect.kind]
    needs = ", ".join(f"c.{name}" for name in effect.context)
    more = [f"It needs the context column {needs}."] if needs else []
    if effect.has_memory and effect.kind == "correction":
        more.append("It remembers earlier frames.")
    return " ".join([told, *more])


async def _draw(service: Service, places: Sequence[tuple[str, ui.element]]) -> None:
    """One after another: the page is there before its pictures."""
    for name, place in places:
        try:
            answer = await service.read(SchematicView, f"/effects/{quote(name)}/schematic")
        except Refusal:
            continue
        with place:
            schematic_view(name, answer)
