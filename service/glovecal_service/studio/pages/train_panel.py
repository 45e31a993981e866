"""A model from chosen takes: which method, one button, its errors, and what to ask next."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

from nicegui import ui
from nicegui.events import ValueChangeEventArguments

from glovecal_models.calibration.answer import Trained
from glovecal_models.improvement.answer import STOPPED, Improved, ImprovedSoFar
from glovecal_models.presentation.document import counted
from glovecal_service.plain import read
from glovecal_service.rest.job.answer import Job, JobFacts, JobRow
from glovecal_service.rest.take.answer import Take
from glovecal_service.studio.amounts import degrees
from glovecal_service.studio.charts.chart import FallChart
from glovecal_service.studio.chosen import MOST_OFFERED
from glovecal_service.studio.heading import act, goes_live, heading, main_act
from glovecal_service.studio.job_watch import JobWatch
from glovecal_service.studio.next_steps import next_steps
from glovecal_service.studio.service import refusals, warn_long
from glovecal_service.studio.studio import Studio

METHODS = {
    "lmc_gpr": "LMC-GPR, the default: a straight line for each joint, a Gaussian process for the rest.",
    "linear": "Linear: a straight line for each joint. Fast, and easy to look into.",
    "auto": "Automatic: each joint's kernel by its evidence, for hardware nobody knows. Slower.",
    "spgp": "Sparse Gaussian process on pseudo-inputs: for very many frames.",
}
MOST_LINKED = 12
MOST_LOOKED_AT = 20
"""Earlier trainings, the newest ones."""


class TrainPanel:
    """Takes of one subject and layout, and what is made of them."""

    def __init__(self, studio: Studio) -> None:
        self._studio = studio
        self._place = ui.element("section").classes("finding").props('aria-label="Train"')
        self._place.set_visibility(False)

    async def build(self, own: Sequence[Take]) -> None:
        """Of the newest of them that teach; where there are none, what to do next."""
        self._place.set_visibility(True)
        takes = [take for take in own if take.teaches]
        if takes:
            last = takes[-1]
            worn = (last.subject, last.layout)
            await self.take_on(*worn, [take.id for take in takes if (take.subject, take.layout) == worn])
        else:
            with self._place:
                await next_steps(self._studio.service)

    async def take_on(self, subject: str, layout: str, imported: Sequence[str]) -> None:
        """Offer to train on them; those that teach nothing are told."""
        newest = {"subject": subject, "layout": layout, "reverse": True, "limit": MOST_OFFERED}
        every = (await self._studio.service.read(list[Take], "/takes", **newest))[::-1]
        own = [take for take in every if take.id in set(imported)]
        teaching = [take for take in every if take.teaches]
        self._subject, self._layout = subject, layout
        self._place.set_visibility(True)
        self._place.clear()
        with self._place:
            heading(2, f"Train a model of {subject}")
            if not teaching:
                ui.label("No angles were measured in these takes: no model can learn from them.")
                return
            options = {take.id: take.line for take in teaching}
            chosen = [take.id for take in own if take.teaches] or list(options)
            self._takes = ui.select(options, value=chosen, multiple=True, label="Takes").classes("choice")
            if len(chosen) <= MOST_LINKED:
                self._takes.props("use-chips")
            else:
                self._takes.props(f'display-value="{counted(len(chosen), "take")}"')
                self._takes.on_value_change(self._count)
            with ui.element("div").classes("page-acts"):
                ui.label("Look at a take first:")
                for take in teaching[:MOST_LINKED]:
                    ui.link(take.name, f"/take?id={take.id}").classes("studio-link")
            took = await self._took()
            methods = {name: f"{what}{took.get(name, '')}" for name, what in METHODS.items()}
            self._method = ui.radio(methods, value="lmc_gpr")
            self._live = goes_live()
            with ui.row().classes("choices"):
                main_act(f"Train on {counted(len(chosen), 'take')}", self._train)
                act("Improve: add what is missing, step by step", self._improve)
            self._watch = JobWatch(self._studio, self._finished, self._grow)
            self._fall = FallChart(label="Held-out error of each step so far").classes("fall")
            self._fall.set_visibility(False)
            self._result = ui.element("div").props('aria-live="polite"')

    async def _took(self) -> dict[str, str]:
        """By method: how long its last training took on this computer, and of how much."""
        done = {"kind": "train", "state": "done", "limit": MOST_LOOKED_AT}
        jobs = await self._studio.service.read(list[JobRow], "/jobs", **done)
        took: dict[str, str] = {}
        for job in jobs:
            if job.took_s is not None:
                took.setdefault(
                    str(job.payload.get("method")), f" Last time: {job.took_s:.0f} s, {job.about}."
                )
        return took

    def _count(self, event: ValueChangeEventArguments) -> None:
        self._takes.props["display-value"] = counted(len(event.value), "take")

    async def _train(self) -> None:
        await self._ask("/models/train")

    async def _improve(self) -> None:
        await self._ask("/improve")

    async def _ask(self, path: str) -> None:
        body = {
            "subject": self._subject, "layout": self._layout, "takes": self._takes.value,
            "method": self._method.value, "activate": self._live.value,
        }  # fmt: skip
        with refusals(warn_long):
            job = await self._studio.service.ask(JobFacts, path, body)
            self._watch.follow(job.id)

    def _grow(self, job: Job) -> None:
        """The steps of an improvement so far, and the place of the next."""
        falls = read(ImprovedSoFar, job.detail).falls if job.kind == "improve" else ()
        self._fall.set_visibility(bool(falls))
        if falls:
            self._fall.show(falls, None)
            self._fall.grow("next effect", job.fraction)

    async def _finished(self, job: Job) -> None:
        self._fall.set_visibility(False)
        if job.state != "done":
            return
        self._result.clear()
        with self._result:
            if job.kind == "improve":
                improved = read(Improved, job.result)
                fall = ", ".join(
                    f"{' '.join(step.label.split())} {degrees(step.rmse_deg)}" for step in improved.falls
                )
                ui.label(f"{fall}. {STOPPED[improved.stopped]}").classes("finding-sentence")
                self._fall.set_visibility(True)
                self._fall.stand()
                self._fall.show(improved.falls, improved.band)
                for tried in improved.undone:
                    ui.label(tried.sentence)
                main_act("See the error fall", lambda: ui.navigate.to(f"/fall?model={improved.last.model}"))
                return
            found = read(Trained, job.result)
            ui.label(f"Held-out error {degrees(found.held_out_rmse_deg)}.").classes("finding-sentence")
            for sentence in found.wearing_sentences:
                ui.label(sentence)
            with ui.element("div").classes("page-acts"):
                main_act("Which effect is missing?", partial(self._diagnose, found.model))
                ui.link("Compare with the measurement", f"/compare?models={found.model}").classes(
                    "studio-link"
                )

    async def _diagnose(self, model: str) -> None:
        with refusals(warn_long):
            await self._studio.service.post(f"/models/{model}/diagnose")
            ui.navigate.to(f"/diagnose?model={model}")
