"""Looking for the effect that a simulated glove hides: what to do next, and whether it was found."""

from __future__ import annotations

from functools import partial

from nicegui import ui

from glovecal_service.rest.first_run.answer import HiddenEffectView
from glovecal_service.studio.heading import heading, quiet_act
from glovecal_service.studio.service import Service, refusals


class HiddenWalk:
    """A section on a page about a model; not there where its subject's glove hides nothing."""

    def __init__(self, service: Service) -> None:
        self._service = service
        self._place = ui.element("div").props('role="status"')

    async def show(self, model: str) -> None:
        """Of the subject of that model."""
        walks = await self._service.read(list[HiddenEffectView], "/hidden-effects")
        self._place.clear()
        for walk in walks:
            if model in walk.models:
                with self._place:
                    walk_section(self._service, walk)


def walk_section(service: Service, walk: HiddenEffectView) -> None:
    """Nothing in it names the effect before one was added, or somebody gives up."""
    with ui.element("section").classes("finding finding-named" if walk.verdict else "finding") as section:
        section.props["aria-label"] = f"Hidden effect of {walk.subject}"
        heading(2, f"The effect hidden in the glove of {walk.subject}")
        for sentence in walk.sentences:
            ui.label(sentence)
        if walk.job is not None:
            ui.label("The model that does not know of it is being trained.")
        if not walk.models:
            return
        first, last = walk.models[0], walk.models[-1]
        if walk.verdict is None:
            ui.label(
                "One effect of the catalogue is at work, and the model does not know of it. Compare shows "
                "where the model fails; Diagnose names what is missing; once you have added it, you are told "
                "here whether it was that. Seldom nothing is named: then you can give up."
            )
        else:
            ui.label(f"Again, in a terminal: glovecal demo --seed {walk.seed}")
        with ui.element("div").classes("page-acts"):
            ui.link("Compare", f"/compare?models={first}").classes("studio-link")
            ui.link("Diagnose", f"/diagnose?model={first}").classes("studio-link")
            if walk.verdict is None:
                quiet_act("I give up: tell me", partial(_reveal, service, walk.subject, section))
            else:
                ui.link("See the error fall", f"/fall?model={last}").classes("studio-link")


async def _reveal(service: Service, subject: str, section: ui.element) -> None:
    with refusals():
        walk = await service.read(HiddenEffectView, f"/hidden-effects/{subject}", reveal=True)
        with section:
            for sentence in walk.sentences:
                ui.label(sentence).classes("finding-sentence")
