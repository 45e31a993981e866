"""The end of a guided sampling: what became of its steps, and what to do with its takes."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

from nicegui import ui
from nicegui.events import ValueChangeEventArguments

from glovecal_models.calibration.answer import Trained
from glovecal_models.quick_check.answer import CheckedWearing
from glovecal_service.plain import read
from glovecal_service.rest.job.answer import Job, JobFacts
from glovecal_service.rest.model.answer import Model
from glovecal_service.rest.sampling.answer import SamplingView
from glovecal_service.rest.take.answer import Take
from glovecal_service.studio.heading import act, goes_live, heading, main_act
from glovecal_service.studio.job_watch import JobWatch
from glovecal_service.studio.pages.take_view import TakeView
from glovecal_service.studio.served_label import ServedLabel
from glovecal_service.studio.service import Refusal, refusals, warn_long
from glovecal_service.studio.studio import Studio

SECOND_WEARING = "second_wearing"

_checking: set[str] = set()
"""Samplings whose check is under way: two pages that show one end must not check twice."""


class SamplingEnd:
    """Of a sampling that is over and whose takes are stored."""

    def __init__(self, studio: Studio, view: SamplingView) -> None:
        self._studio = studio
        self._view = view

    async def build(self) -> None:
        view = self._view
        good = sum(step.outcome == "good" for step in view.steps)
        with ui.element("section").classes("card capture-end").props('aria-label="Result" tabindex="-1"'):
            heading(2, "Done" if view.phase == "done" else "Stopped")
            takes = "1 take" if len(view.takes) == 1 else f"{len(view.takes)} takes"
            ui.label(
                f"{good} of {len(view.steps)} steps are good, {takes} stored for {view.subject}; "
                f"{view.capture_s:.0f} s of capture."
            ).classes("finding-sentence").props('role="status"')
            for sentence in (*view.sentences, view.problem):
                if sentence:
                    ui.label(sentence)
            self._left_open()
            with ui.element("div").classes("capture-acts"):
                if view.takes and view.protocol != SECOND_WEARING:
                    name = "Train a template" if view.method == "template" else "Train a model"
                    main_act(name, self._train, large=True)
                    self._live = goes_live()
                ui.link("New sampling", "/capture?mode=sampling").classes("studio-link")
            self._watch = JobWatch(self._studio, self._trained)
            self._after = ui.element("div").classes("findings").props('aria-live="polite"')
            if view.takes:
                with refusals():
                    await RecordedTakes(self._studio, view.takes).build()
        if view.takes and view.protocol == SECOND_WEARING:
            await self._check()

    def _left_open(self) -> None:
        open_steps = [step for step in self._view.steps if step.outcome != "good"]
        if not open_steps:
            return
        with ui.expansion(f"Steps that are not good: {len(open_steps)}").classes("capture-steps"):
            for step in open_steps:
                ui.label(f"{step.name}: {step.outcome or 'not done'}. {' '.join(step.reasons)}")

    async def _train(self) -> None:
        with refusals(warn_long):
            worn = {"subject": self._view.subject, "layout": self._view.layout}
            own = {"method": self._view.method, "activate": self._live.value}
            body = worn | own | {"hand": await self._hand()}
            job = await self._studio.service.ask(JobFacts, "/models/train", body)
            self._watch.follow(job.id)

    async def _hand(self) -> str | None:
        """That its takes are of; None where capture does not know it."""
        takes = self._view.takes
        return (await self._studio.service.read(Take, f"/takes/{takes[0]}")).known_hand if takes else None

    async def _trained(self, job: Job) -> None:
        if job.state != "done":
            return
        with self._after, ui.element("div"):
            found = read(Trained, job.result)
            if found.active:
                ServedLabel(self._studio, self._view.glove, found.model, "Trained")
            else:
                ui.label("Trained. Live poses do not come from it.").props('role="status"')
                act("Use it live", partial(self._activate, found.model, "The trained model is active"))
            ui.link("See the hand live", "/live").classes("studio-link")
            ui.link("Which effect is missing?", f"/diagnose?model={found.model}").classes("studio-link")
            ui.link("See its error", f"/compare?models={found.model}").classes("studio-link")

    async def _check(self) -> None:
        """The active model learns the shift of this wearing; the child is served if that made it better."""
        id = self._view.id
        if id in _checking:
            with self._after:
                ui.label("Another page checks this wearing.")
            return
        _checking.add(id)
        try:
            await self._check_once()
        finally:
            _checking.discard(id)

    async def _check_once(self) -> None:
        service, view = self._studio.service, self._view
        worn = {"subject": view.subject, "layout": view.layout, "hand": await self._hand()}
        models = await service.every(Model, "/models", **worn)
        if any(each.facts.get("quick_check", {}).get("takes") == view.takes for each in models):
            with self._after:
                ui.label("This wearing is checked; its model is on the page Models.")
            return
        active = next((each.id for each in models if each.active), None)
        try:
            if active is None:
                raise Refusal(409, f"No model is active for {view.subject}: there is nothing to check.")
            body = {"takes": view.takes, "activate": False}
            found = await service.ask(CheckedWearing, f"/models/{active}/quick-check", body)
        except Refusal as refusal:
            with self._after:
                ui.label(str(refusal)).classes("studio-problem").props('role="alert"')
            return
        is_better = found.as_left_deg is not None and found.as_left_deg <= found.as_found_deg
        if is_better:
            await service.post(f"/models/{found.model}/activate")
        with self._after, ui.element("section").classes("finding"):
            heading(2, f"Wearing {found.wearing} is checked")
            if is_better:
                ServedLabel(self._studio, view.glove, found.model, "The model is checked")
            else:
                ui.label("The model stays as it was: its poses are not better after the check.").classes(
                    "finding-sentence"
                )
            for sentence in found.sentences:
                ui.label(sentence)
            if not is_better:
                act(
                    "Use the checked model",
                    partial(self._activate, found.model, "The checked model is active"),
                )
            ui.link("See the hand live", "/live").classes("studio-link")

    async def _activate(self, model: str, what: str) -> None:
        with refusals():
            await self._studio.service.post(f"/models/{model}/activate")
            with self._after:
                ServedLabel(self._studio, self._view.glove, model, what)


class RecordedTakes:
    """The takes of a sampling, one looked at at a time."""

    def __init__(self, studio: Studio, takes: Sequence[str]) -> None:
        self._studio = studio
        self._takes = takes

    async def build(self) -> None:
        service = self._studio.service
        self._known = [await service.read(Take, f"/takes/{id}") for id in self._takes]
        names = {take.id: take.line for take in self._known}
        heading(2, "What was recorded")
        ui.select(names, value=self._known[0].id, label="Take", on_change=self._choose).classes("choice")
        self._place = ui.element("div")
        await self._show(self._known[0].id)

    async def _choose(self, event: ValueChangeEventArguments) -> None:
        await self._show(event.value)

    async def _show(self, id: str) -> None:
        self._place.clear()
        with self._place:
            await TakeView(self._studio, next(take for take in self._known if take.id == id)).build()
