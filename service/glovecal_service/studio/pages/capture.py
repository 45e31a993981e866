"""Capture: guided sampling, free recording and the check of a new wearing, for hands that wear a glove."""

from __future__ import annotations

from dataclasses import replace

from nicegui import ui
from pydantic import ValidationError

from glovecal_models.diagnosis.answer import MissingEffects
from glovecal_models.improvement.answer import Improved
from glovecal_service.plain import read
from glovecal_service.rest.glove.answer import Gloves
from glovecal_service.rest.job.answer import Job
from glovecal_service.rest.sampling.answer import SamplingView
from glovecal_service.studio.next_steps import connect_or_try
from glovecal_service.studio.pages.capture_recording import RecordingPage
from glovecal_service.studio.pages.capture_sampling import SamplingPage
from glovecal_service.studio.pages.capture_session import SessionPage
from glovecal_service.studio.pages.capture_start import SamplingForm, WearingForm
from glovecal_service.studio.pages.take_view import add_take_styles
from glovecal_service.studio.repeating import again
from glovecal_service.studio.service import Refusal, refusals
from glovecal_service.studio.shell import page, shell
from glovecal_service.studio.studio import Studio

MODES = {
    "sampling": "Guided sampling",
    "recording": "Free recording",
    "wearing": "New wearing",
    "session": "Session",
}
PROPOSING: dict[str, type[MissingEffects] | type[Improved]] = {
    "diagnose": MissingEffects,
    "improve": Improved,
}
"""Jobs that may want takes."""
AGAIN_EVERY_S = 2.0


def add(studio: Studio) -> None:
    """``/studio/capture``: ``sampling`` follows that one, ``proposal`` is a diagnosis that wants takes,
    ``place`` which of them is next, from 1."""

    @page("/capture")
    async def capture(mode: str = "", sampling: str = "", proposal: str = "", place: int = 1) -> None:
        wanted = mode if mode in MODES else "recording" if proposal else "sampling"
        async with shell(studio, "capture", "Capture"):
            add_take_styles()
            await CapturePage(studio, wanted).build(sampling, proposal, place)


class CapturePage:
    """One open page: a sampling or recording that goes on comes before the form for a new one."""

    def __init__(self, studio: Studio, mode: str) -> None:
        self._studio = studio
        self._mode = mode

    async def build(self, sampling: str, proposal: str, place: int) -> None:
        with ui.element("nav").props('aria-label="Ways to capture"').classes("studio-nav capture-modes"):
            for mode, name in MODES.items():
                link = ui.link(name, f"/capture?mode={mode}").classes("studio-tab")
                if mode == self._mode:
                    link.props('aria-current="true"')
        self._main = ui.element("div").classes("capture")
        gloves = (await self._studio.service.read(Gloves, "/gloves")).seen
        if not gloves:
            ui.label("No glove was seen yet. Run: glovecal capture --device DEVICE --glove NAME").classes(
                "studio-notice"
            )
            connect_or_try()
            again(AGAIN_EVERY_S, self._again)
            return
        with self._main:
            if self._mode == "recording":
                proposed = await self._proposed(proposal)
                plan = None if proposed is None else proposed.to_record
                subject = None if proposed is None else proposed.subject
                await RecordingPage(self._studio, gloves).build(proposal, plan, subject, place)
                return
            if self._mode == "session":
                await SessionPage(self._studio).build()
                return
            view = await self._open_sampling(sampling)
            if view is not None:
                await SamplingPage(self._studio, view).build()
                return
            form = WearingForm if self._mode == "wearing" else SamplingForm
            await form(self._studio, gloves, self._started).build()

    async def _started(self, view: SamplingView) -> None:
        ui.navigate.history.replace(f"?mode={self._mode}&sampling={view.id}")
        self._main.clear()
        with self._main:
            await SamplingPage(self._studio, view).build()

    async def _open_sampling(self, wanted: str) -> SamplingView | None:
        """``wanted``, else the newest that goes on."""
        if wanted:
            with refusals():
                return await self._studio.service.read(SamplingView, f"/sampling/{wanted}")
        found = await self._studio.service.read(list[SamplingView], "/sampling", only_open=True)
        for other in found[1:]:
            ui.link(
                f"Also going on: {other.subject} with {other.glove}",
                f"/capture?sampling={other.id}",
            ).classes("studio-link")
        return found[0] if found else None

    async def _proposed(self, job: str) -> MissingEffects | Improved | None:
        """A diagnosis, or an improvement's last, with its subject."""
        if not job:
            return None
        try:
            found = await self._studio.service.read(Job, f"/jobs/{job}")
        except Refusal as refusal:
            ui.notify(str(refusal), type="warning")
            return None
        try:
            answered = read(PROPOSING[found.kind], found.result)
        except (KeyError, ValidationError):  # another kind's, or of another version
            return None
        return replace(answered, subject=found.subject)

    async def _again(self) -> None:
        if (await self._studio.service.read(Gloves, "/gloves")).seen:
            ui.navigate.reload()
