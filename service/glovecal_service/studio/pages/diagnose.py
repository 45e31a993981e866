"""Diagnose: what the model lacks, how sure that is, how much it saves beside its control; add it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import Any
from urllib.parse import quote

from nicegui import ui
from nicegui.elements.mixins.text_element import TextElement
from pydantic import ValidationError

from glovecal_models.diagnosis.answer import MissingEffects, NamedEffect
from glovecal_models.improvement.answer import EffectAdded
from glovecal_service.plain import read
from glovecal_service.rest.effect.answer import CatalogueEffect
from glovecal_service.rest.job.answer import Job, JobFacts, JobRow
from glovecal_service.rest.model.answer import Model
from glovecal_service.studio.amounts import degrees
from glovecal_service.studio.findings.candidate_table import bar_key, candidate_table
from glovecal_service.studio.findings.effect_view import EffectView
from glovecal_service.studio.heading import goes_live, heading
from glovecal_service.studio.hidden_walk import HiddenWalk
from glovecal_service.studio.job_watch import JobWatch
from glovecal_service.studio.repeating import soon
from glovecal_service.studio.service import Refusal
from glovecal_service.studio.shell import page, shell
from glovecal_service.studio.studio import Studio

OF_ANOTHER_VERSION = "This model was diagnosed by another version of Glovecal; diagnose it again."
SHOWN_CANDIDATES = 6
MOST_PARAMETERS = 4


def add(studio: Studio) -> None:
    """``/studio/diagnose``."""

    @page("/diagnose")
    async def diagnose() -> None:
        async with shell(studio, "diagnose", "Diagnose", about_models=True) as around:
            ui.add_head_html('<link rel="stylesheet" href="/studio/static/findings.css">')
            if model := await around.model(studio.service):
                await DiagnosePage(studio, model).build()


class DiagnosePage:
    """One open page."""

    def __init__(self, studio: Studio, model: Model) -> None:
        self._studio = studio
        self._model, self._subject = model.id, model.subject
        self._goes_live = False

    async def build(self) -> None:
        ui.button("Diagnose", on_click=self._diagnose).props("unelevated no-caps color=indigo-8").classes(
            "studio-main-act"
        )
        self._walk = HiddenWalk(self._studio.service)
        self._watch = JobWatch(self._studio, self._finished)
        self._findings = ui.element("div").classes("findings").props('aria-live="polite"')
        await self._show_last()

    async def _show_last(self) -> None:
        """What was found for this model before, or that is under way."""
        self._findings.clear()
        await self._walk.show(self._model)
        service = self._studio.service
        jobs = await service.every(JobRow, "/jobs", subject=self._subject, text=self._model)
        own = [
            job
            for job in jobs
            if job.kind in ("diagnose", "add_effect") and job.payload.get("model") == self._model
        ]
        running = next((job for job in own if job.finished_at is None), None)
        if running is not None:
            self._watch.follow(running.id)
        last = next((job for job in own if job.kind == "diagnose" and job.state == "done"), None)
        with self._findings:
            if last is None:
                ui.label("Not diagnosed yet: which physical effect does this model lack?")
            else:
                await self._show_found(await service.read(Job, f"/jobs/{last.id}"))

    async def _diagnose(self) -> None:
        await self._ask(f"/models/{self._model}/diagnose", {})

    async def _add(self, effect: str, rotations: list[str] | None) -> None:
        await self._ask(
            f"/models/{self._model}/effects",
            {"effect": effect, "rotations": rotations, "activate": self._goes_live},
        )

    async def _ask(self, path: str, body: Mapping[str, Any]) -> None:
        try:
            job = await self._studio.service.ask(JobFacts, path, body)
        except Refusal as refusal:
            ui.notify(str(refusal), type="warning")
            return
        self._watch.follow(job.id)

    async def _finished(self, job: Job) -> None:
        if job.kind == "diagnose" or job.state != "done":
            await self._show_last()
            return
        result = read(EffectAdded, job.result)
        self._findings.clear()
        await self._walk.show(self._model)
        with self._findings, ui.element("section").classes("finding finding-named"):
            heading(2, f"{result.effect} was {'added' if result.added else 'not kept'}")
            ui.label(result.sentence)
            if result.model:
                with ui.element("div").classes("page-acts"):
                    ui.link("See the error fall", f"/fall?model={result.model}").classes("studio-link")
                    ui.link("Diagnose again", f"/diagnose?model={result.model}").classes("studio-link")
                view = EffectView(
                    self._studio.service, result.effect, job.payload["takes"],
                    before=result.parent, after=result.model,
                )  # fmt: skip
                soon(partial(view.show, next(iter(result.where), None)))

    async def _show_found(self, job: Job) -> None:
        try:
            found = read(MissingEffects, job.result)
        except ValidationError:
            ui.label(OF_ANOTHER_VERSION)
        else:
            await self._show(job.id, found)

    async def _show(self, job: str, found: MissingEffects) -> None:
        named = found.named
        for sentence in found.sentences[:1] if named is None else [named.sentence]:
            ui.label(sentence).classes("finding-sentence")
        view = None if named is None else await self._named(found, named)
        if found.candidates:
            with ui.element("section").classes("finding"):
                heading(2, "Smoothed error with each effect")
                candidate_table(found.candidates[:SHOWN_CANDIDATES])
                bar_key()
                for sentence in found.about_candidates:
                    ui.label(sentence)
        self._recorded(found)
        self._remains(found)
        _to_record(job, found)
        if found.not_shown:
            with ui.element("section").classes("finding"):
                heading(2, "Not judged: what these takes could not show")
                _listed([f"{sentence}." for sentence in found.not_shown])
        ui.link("Report with pictures", f"../v1/jobs/{job}/report", new_tab=True).classes("studio-link")
        if view is not None:
            soon(partial(view.show, found.clearest_rotation))

    async def _named(self, found: MissingEffects, named: NamedEffect) -> EffectView:
        """What it is and how sure, beside the picture that shows it."""
        models = await self._studio.service.every(Model, "/models", subject=self._subject, reverse=True)
        child = next((each for each in models if _has_gained(each, found, named)), None)
        with ui.element("section").classes("finding finding-named"):
            heading(2, f"{named.effect} on {', '.join(named.where)}")
            with ui.element("div").classes("finding-pair"):
                with ui.element("div").classes("finding-facts"):
                    ui.label(named.verdict).classes("state-word")
                    ui.label(await self._explanation(named.effect))
                    _facts(named)
                    _rivals(named)
                    ui.link("What is this effect?", f"/effects#{quote(named.effect)}").classes("studio-link")
                    self._offer(named, child)
                return EffectView(
                    self._studio.service, named.effect, [take.id for take in found.takes],
                    before=found.model or "", after=None if child is None else child.id,
                )  # fmt: skip

    async def _explanation(self, effect: str) -> str:
        try:
            return (await self._studio.service.read(CatalogueEffect, f"/effects/{quote(effect)}")).explanation
        except Refusal:
            return "An effect of your own, or one that is not installed here."

    def _offer(self, named: NamedEffect, child: Model | None) -> None:
        if named.method:
            ui.label(f"To be trained with {named.method}: a straight line cannot learn it.")
            return
        if named.kind == "finding":
            ui.label("Hardware fault: fix the glove. No model version corrects it.")
            return
        goes_live(lambda event: setattr(self, "_goes_live", event.value))
        ui.button(f"Add {named.effect}", on_click=lambda: self._add(named.effect, list(named.where))).props(
            "unelevated no-caps color=indigo-8"
        ).classes("studio-main-act")
        if child is not None:
            ui.label("A version with it is there: dashed in the picture.")
            ui.link("See the error fall", f"/fall?model={child.id}").classes("studio-link")

    def _recorded(self, found: MissingEffects) -> None:
        """What is known by a signature in the recording, and problems of the reference."""
        shown = None if found.named is None else found.named.sentence
        told = [one for note in found.of_the_recording for one in note.sentences if one != shown]
        if told:
            with ui.element("section").classes("finding"):
                heading(2, "Found in the recording")
                _listed(told)

    def _remains(self, found: MissingEffects) -> None:
        """What is left, and what each association of it asks for."""
        left = found.unexplained_residual
        if left is None and not found.actions:
            return
        with ui.element("section").classes("finding"):
            heading(2, "What remains unexplained")
            if left is not None:
                ui.label(left.sentence)
            for action in found.actions:
                with ui.element("div").classes("action-row"):
                    ui.label(action.sentence)
                    if action.effect and action.saves:
                        ui.button(
                            f"Add {action.effect}",
                            on_click=partial(self._add, action.effect, [action.rotation]),
                        ).props("outline no-caps").classes("studio-target")


def _to_record(job: str, found: MissingEffects) -> None:
    """What would decide more, and the start of its recording; taps are no take, their text names the
    command."""
    following, plan = found.unplanned_take, found.to_record
    if following is None and plan is None:
        return
    with ui.element("section").classes("finding"):
        heading(2, "What to record next")
        if plan is not None:
            ui.label(plan.heading)
            _listed([step.sentence for step in plan.steps], "ol")
            ui.label(plan.columns_sentence)
            ui.button(
                "Record it" if len(plan.each_take) == 1 else "Record them",
                on_click=lambda: ui.navigate.to(f"/capture?proposal={job}"),
            ).props("unelevated no-caps color=indigo-8").classes("studio-main-act")
        elif following is not None:
            ui.label(following.sentence)


def _has_gained(model: Model, found: MissingEffects, named: NamedEffect) -> bool:
    return model.parent == found.model and named.effect in model.effects


def _facts(named: NamedEffect) -> None:
    with ui.element("dl"):
        for name, value in (
            ("saves of the smoothed error", degrees(named.saved_deg)),
            ("its control saves", degrees(named.control_saved_deg)),
            *_learned(named.parameters),
        ):
            TextElement(tag="dt", text=name)
            TextElement(tag="dd", text=value)
    if named.saved_deg is None:
        ui.label("Found by its signature in the recording, not by what it saves.")


def _rivals(named: NamedEffect) -> None:
    if named.rivals:
        ui.label(f"Confidence set: {', '.join(named.confidence_set)}. These takes cannot tell them apart.")
    else:
        ui.label("No other effect explains these takes as well.")


def _learned(parameters: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """Each learned number with its range over rotations, its unit in its name."""
    by_name: dict[str, list[float]] = {}
    for values in parameters.values():
        for name, value in values.items() if isinstance(values, Mapping) else ():
            if isinstance(value, int | float):
                by_name.setdefault(name, []).append(value)
    for name, values in list(by_name.items())[:MOST_PARAMETERS]:
        low, high = (f"{value:.3g}" for value in (min(values), max(values)))
        words, _, unit = name.rpartition("_")
        yield words.replace("_", " ") or name, f"{low if low == high else f'{low} to {high}'} {unit}"


def _listed(sentences: Sequence[str], tag: str = "ul") -> None:
    with ui.element(tag).classes("reasons"):
        for sentence in sentences:
            TextElement(tag="li", text=sentence)
