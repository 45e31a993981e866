"""What to do next: at length on a page that has nothing to show, in a line on every other."""

from __future__ import annotations

import json
from contextlib import suppress

from nicegui import ui
from nicegui.elements.mixins.text_element import TextElement

from glovecal_service.plain import read
from glovecal_service.rest.overview.answer import Overview
from glovecal_service.studio.chosen import Chosen
from glovecal_service.studio.heading import heading, quiet_act
from glovecal_service.studio.service import Refusal, Service


async def next_steps(service: Service, about: Chosen | None = None) -> ui.element:
    """A section that can be hidden. ``about``: whose steps, and of which model; None: of the newest."""
    found = await _overview(service, about)
    with ui.element("section").classes("finding next-steps").props('aria-label="What to do next"') as section:
        heading(2, "What to do next")
        ui.label(found.sentence)
        for step in found.steps:
            with ui.element("div").classes("next-step"):
                ui.link(step.label, f"/{step.page}").classes("studio-link next-step-act")
                ui.label(step.sentence)
                command_to_copy(step.command)
    return section


class NextStepLine:
    """The usual one in a line, for a page that has more to show; ``here`` is its address."""

    def __init__(self, service: Service, about: Chosen, here: str) -> None:
        self._service, self._about, self._here = service, about, here
        self._line = ui.element("div").classes("next-in-a-line").props('role="note" aria-label="Next step"')

    async def look(self, about: Chosen | None = None) -> None:
        """Again, once something was done. ``about``: whose step from now on; None: as before."""
        self._about = about or self._about
        with suppress(Refusal):  # the page itself says what is wrong
            step = (await _overview(self._service, self._about)).steps[0]
            self._line.clear()
            with self._line:
                ui.label("Next:")
                ui.label(step.sentence)
                if step.page.partition("?")[0] != self._here:
                    ui.link(step.label, f"/{step.page}").classes("studio-link")


async def _overview(service: Service, about: Chosen | None) -> Overview:
    query: dict[str, str] = {}
    if about is not None and about.person:
        query["subject"] = about.person
        if about.model is not None:
            query["model"] = about.model.id
    return read(Overview, await service.get("/overview", **query))


def connect_or_try() -> None:
    """The way in, on a page that needs a glove."""
    with ui.element("div").classes("page-acts"):
        ui.link("Connect a glove", "/start#connect").classes("studio-link")
        ui.link("Try a simulated glove", "/start").classes("studio-link")


def command_to_copy(command: str) -> None:
    with ui.element("span").classes("next-step-command"):
        TextElement(tag="code", text=command)
        copy = f"() => navigator.clipboard?.writeText({json.dumps(command)})"
        button = quiet_act("Copy", lambda: None).on("click", js_handler=copy)
        button.props["aria-label"] = f"Copy: {command}"
