"""Diagnose: what the model lacks, how sure that is, how much it saves beside its control; add it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import Any
from urllib.parse import quote

from nicegui import ui
from nicegui.elements.mixins.text_element import TextElement

from glovecal_service.studio.amounts import degrees
from glovecal_service.studio.findings.candidate_table import bar_key, candidate_table
from glovecal_service.studio.findings.effect_view import EffectView, clearest_rotation
from glovecal_service.studio.heading import heading
from glovecal_service.studio.job_watch import JobWatch
from glovecal_service.studio.pages.model_select import model_select
from glovecal_service.studio.service import Refusal
from glovecal_service.studio.shell import page, shell
from glovecal_service.studio.studio import Studio

SHOWN_CANDIDATES = 6
MOST_PARAMETERS = 4


def add(studio: Studio) -> None:
    """``/studio/diagnose``."""

    @page("/diagnose")
    async def diagnose(model: str = "") -> None:
        with shell(studio, "diagnose", "Diagnose"):
            ui.add_head_html('<link rel="stylesheet" href="/studio/static/findings.css">')
            await DiagnosePage(studio, model).build()


class DiagnosePage:
    """One open page."""

    def __init__(self, studio: Studio, model: str) -> None:
        self._studio = studio
        self._model = model

    async def build(self) -> None:
        with ui.row().classes("choices"):
            model = await model_select(self._studio.service, self._model, self._choose)
            if model is None:
                return
            self._model = model
            ui.button("Diagnose", on_click=self._diagnose).props("unelevated no-caps color=indigo-8").classes(
                "studio-main-act"
            )
        self._watch = JobWatch(self._studio, self._finished)
        self._findings = ui.element("div").classes("findings").props('aria-live="polite"')
        await self._show_last()

    async def _choose(self, model: str) -> None:
        self._model = model
        await self._show_last()

    async def _show_last(self) -> None:
        """What was found for this model before, or that is under way."""
        self._findings.clear()
        jobs = await self._studio.service.get("/jobs")
        own = [
            job
            for job in jobs
            if job["kind"] in ("diagnose", "add_effect") and job["payload"].get("model") == self._model
        ]
        running = next((job for job in own if job["finished_at"] is None), None)
        if running is not None:
            self._watch.follow(running["id"])
        last = next((job for job in own if job["kind"] == "diagnose" and job["state"] == "done"), None)
        with self._findings:
            if last is None:
                ui.label("Not diagnosed yet: which physical effect does this model lack?")
            else:
                await self._show(last)

    async def _diagnose(self) -> None:
        await self._ask(f"/models/{self._model}/diagnose", {})

    async def _add(self, effect: str, rotations: list[str] | None) -> None:
        await self._ask(
            f"/models/{self._model}/effects", {"effect": effect, "rotations": rotations, "activate": True}
        )

    async def _ask(self, path: str, body: Mapping[str, Any]) -> None:
        try:
            job = await self._studio.service.post(path, body)
        except Refusal as refusal:
            ui.notify(str(refusal), type="warning")
            return
        self._watch.follow(job["id"])

    async def _finished(self, job: Mapping[str, Any]) -> None:
        if job["kind"] == "diagnose" or job["state"] != "done":
            await self._show_last()
            return
        result = job["result"]
        self._findings.clear()
        with self._findings, ui.element("section").classes("finding finding-named"):
            heading(
                2,
                f"{result['effect']} was added" if result["added"] else f"{result['effect']} was not kept",
            )
            ui.label(result["sentence"])
            if result["model"]:
                with ui.element("div").classes("page-acts"):
                    ui.link("See the error fall", f"/fall?model={result['model']}").classes("studio-link")
                    ui.link("Diagnose again", f"/diagnose?model={result['model']}").classes("studio-link")
                view = EffectView(
                    self._studio.service, result["effect"], job["payload"]["takes"],
                    before=result["parent"], after=result["model"],
                )  # fmt: skip
                ui.timer(0.0, partial(view.show, (result["where"] or [None])[0]), once=True)

    async def _show(self, job: Mapping[str, Any]) -> None:
        found = job["result"]
        named = found["named"]
        for sentence in found["sentences"][:1] if named is None else [named["sentence"]]:
            ui.label(sentence).classes("finding-sentence")
        view = None if named is None else await self._named(found, named)
        if found["candidates"]:
            with ui.element("section").classes("finding"):
                heading(2, "Smoothed error with each effect")
                candidate_table(found["candidates"][:SHOWN_CANDIDATES])
                bar_key()
        self._recorded(found)
        self._remains(found)
        if found["next_take"]:
            with ui.element("section").classes("finding"):
                heading(2, "What to record next")
                _next_take(found["next_take"])
                if found["next_take"].get("motion") != "taps":  # no take: its text names the command
                    ui.link("Record it", f"/capture?proposal={job['id']}").classes("studio-link")
        _unjudged(found)
        ui.link("Report with pictures", f"../v1/jobs/{job['id']}/report", new_tab=True).classes("studio-link")
        if view is not None and named is not None:
            rotation = clearest_rotation(found, named["effect"], named["where"])
            ui.timer(0.0, partial(view.show, rotation), once=True)

    async def _named(self, found: Mapping[str, Any], named: Mapping[str, Any]) -> EffectView:
        """What it is and how sure, beside the picture that shows it."""
        models = await self._studio.service.get("/models")
        child = next((each for each in reversed(models) if _has_gained(each, found, named)), None)
        with ui.element("section").classes("finding finding-named"):
            heading(2, f"{named['effect']} on {', '.join(named['where'])}")
            with ui.element("div").classes("finding-pair"):
                with ui.element("div").classes("finding-facts"):
                    ui.label(named["verdict"]).classes("state-word")
                    ui.label(await self._explanation(named["effect"]))
                    _facts(named)
                    _rivals(named)
                    ui.link("What is this effect?", f"/effects#{quote(named['effect'])}").classes(
                        "studio-link"
                    )
                    self._offer(named, child)
                takes = [take["id"] for take in found["takes"]]
                return EffectView(
                    self._studio.service, named["effect"], takes, before=found["model"],
                    after=None if child is None else child["id"],
                )  # fmt: skip

    async def _explanation(self, effect: str) -> str:
        try:
            return (await self._studio.service.get(f"/effects/{quote(effect)}"))["explanation"]
        except Refusal:
            return "An effect of your own, or one that is not installed here."

    def _offer(self, named: Mapping[str, Any], child: Mapping[str, Any] | None) -> None:
        if named["method"]:
            ui.label(f"To be trained with {named['method']}: a straight line cannot learn it.")
            return
        if named.get("kind") == "finding":
            ui.label("To be put right at the glove: no version of the model is better for it.")
            return
        ui.button(
            f"Add {named['effect']}", on_click=lambda: self._add(named["effect"], named["where"])
        ).props("unelevated no-caps color=indigo-8").classes("studio-main-act")
        if child is not None:
            ui.label("A version with it is there: dashed in the picture.")
            ui.link("See the error fall", f"/fall?model={child['id']}").classes("studio-link")

    def _recorded(self, found: Mapping[str, Any]) -> None:
        """What is known by a signature in the recording, and problems of the reference."""
        told = [item["sentence"] for item in (*found.get("odd_takes", ()), *found["findings"])]
        told += [*found.get("excluded", ()), *found["reference_problems"]]
        named = found["named"]
        told = [sentence for sentence in told if named is None or sentence != named["sentence"]]
        if told:
            with ui.element("section").classes("finding"):
                heading(2, "Found in the recording")
                _listed(told)

    def _remains(self, found: Mapping[str, Any]) -> None:
        """What is left, and what each association of it asks for."""
        left = found["unexplained_residual"]
        if left is None and not found["actions"]:
            return
        with ui.element("section").classes("finding"):
            heading(2, "What remains unexplained")
            if left is not None:
                ui.label(left["sentence"])
            for action in found["actions"]:
                with ui.element("div").classes("action-row"):
                    ui.label(action["sentence"])
                    if action["effect"] and action["saves"]:
                        ui.button(
                            f"Add {action['effect']}",
                            on_click=partial(self._add, action["effect"], [action["rotation"]]),
                        ).props("outline no-caps").classes("studio-target")


def _has_gained(model: Mapping[str, Any], found: Mapping[str, Any], named: Mapping[str, Any]) -> bool:
    return model["parent"] == found["model"] and named["effect"] in model["effects"]


def _facts(named: Mapping[str, Any]) -> None:
    with ui.element("dl"):
        for name, value in (
            ("saves of the smoothed error", degrees(named["saved_deg"])),
            ("its control saves", degrees(named["control_saved_deg"])),
            *_learned(named["parameters"]),
        ):
            TextElement(tag="dt", text=name)
            TextElement(tag="dd", text=value)
    if named["saved_deg"] is None:
        ui.label("Found by its signature in the recording, not by what it saves.")


def _rivals(named: Mapping[str, Any]) -> None:
    if len(named["confidence_set"]) > 1:
        ui.label(f"Confidence set: {', '.join(named['confidence_set'])}. These takes cannot tell them apart.")
    else:
        ui.label("Confidence set: this effect alone.")


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


def _next_take(following: Mapping[str, Any]) -> None:
    rivals = " and ".join(following["separates"] or ())
    ui.label(following["what"])
    ui.label(f"{following['seconds']} s" + (f"; tells {rivals} apart." if rivals else "."))


def _unjudged(found: Mapping[str, Any]) -> None:
    """Effects by the reason why these takes could not show them."""
    by_reason: dict[str, list[str]] = {}
    for item in found["not_identifiable"]:
        by_reason.setdefault(item["why"], []).append(item["effect"])
    if by_reason:
        with ui.element("section").classes("finding"):
            heading(2, "Not judged: what these takes could not show")
            _listed([f"{', '.join(names)}: {why}." for why, names in by_reason.items()])


def _listed(sentences: Sequence[str]) -> None:
    with ui.element("ul").classes("reasons"):
        for sentence in sentences:
            TextElement(tag="li", text=sentence)
