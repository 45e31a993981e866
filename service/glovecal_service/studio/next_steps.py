"""What to do next, on a page that has nothing to show: each step as a button, and as the command to copy."""

from __future__ import annotations

import json

from nicegui import ui
from nicegui.elements.mixins.text_element import TextElement

from glovecal_service.plain import read
from glovecal_service.rest.overview.answer import Overview
from glovecal_service.studio.heading import heading, quiet_act
from glovecal_service.studio.service import Service


async def next_steps(service: Service) -> ui.element:
    """A section that can be hidden."""
    found = read(Overview, await service.get("/overview"))
    with ui.element("section").classes("finding next-steps").props('aria-label="What to do next"') as section:
        heading(2, "What to do next")
        ui.label(found.sentence)
        for step in found.steps:
            with ui.element("div").classes("next-step"):
                ui.link(step.label, f"/{step.page}").classes("studio-link next-step-act")
                ui.label(step.sentence)
                command_to_copy(step.command)
    return section


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
