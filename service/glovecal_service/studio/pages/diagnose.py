"""Diagnose: what the model lacks, how sure that is, how much it saves beside its control; add it."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any
from urllib.parse import quote

from nicegui import ui

from glovecal_service.studio.amounts import degrees
from glovecal_service.studio.heading import heading
from glovecal_service.studio.job_watch import JobWatch
from glovecal_service.studio.pages.model_select import model_select
from glovecal_service.studio.service import Refusal
from glovecal_service.studio.shell import shell
from glovecal_service.studio.studio import Studio

SHOWN_CANDIDATES = 6


def add(studio: Studio) -> None:
    """``/studio/diagnose``."""

    @ui.page("/diagnose")
    async def diagnose(model: str = "") -> None:
        with shell(studio, "diagnose", "Diagnose"):
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
                self._show(last)

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
        with self._findings, ui.element("section").classes("finding"):
            heading(
                2,
                f"{result['effect']} was added" if result["added"] else f"{result['effect']} was not kept",
            )
            ui.label(result["sentence"])
            if result["model"]:
                ui.link("See the error fall", f"/fall?model={result['model']}").classes("studio-link")
                ui.link("Diagnose again", f"/diagnose?model={result['model']}").classes("studio-link")

    def _show(self, job: Mapping[str, Any]) -> None:
        found = job["result"]
        named = found["named"]
        for sentence in found["sentences"][:1] if named is None else [named["sentence"]]:
            ui.label(sentence).classes("finding-sentence")
        if named is not None:
            self._named(named)
        self._candidates(found)
        self._actions(found)
        self._unjudged(found)
        if found["next_take"]:
            with ui.element("section").classes("finding"):
                heading(2, "What to record next")
                ui.label(found["next_take"]["what"])
        ui.link("Report with pictures", f"../v1/jobs/{job['id']}/report", new_tab=True).classes("studio-link")

    def _named(self, named: Mapping[str, Any]) -> None:
        with ui.element("section").classes("finding finding-named"):
            heading(2, f"{named['effect']} on {', '.join(named['where'])}")
            with ui.row():
                ui.label(named["verdict"]).classes("state-word")
                saved, control = degrees(named["saved_deg"]), degrees(named["control_saved_deg"])
                ui.label(f"saves {saved} on held-out takes, its control {control}")
            if len(named["confidence_set"]) > 1:
                ui.label(f"Confidence set: {', '.join(named['confidence_set'])}.")
            ui.link("What is this effect?", f"/effects#{quote(named['effect'])}").classes("studio-link")
            if named["method"]:
                ui.label(f"To be trained with {named['method']}: a straight line cannot learn it.")
            else:
                ui.button(
                    f"Add {named['effect']}", on_click=lambda: self._add(named["effect"], named["where"])
                ).props("unelevated no-caps color=indigo-8").classes("studio-main-act")

    def _candidates(self, found: Mapping[str, Any]) -> None:
        with ui.element("section").classes("finding"):
            heading(2, "Held-out error with each effect")
            rows = [
                {
                    "effect": item["effect"],
                    "before": degrees(item["rmse_before_deg"]),
                    "after": degrees(item["rmse_after_deg"]),
                    "control": degrees(item["rmse_control_deg"]),
                    "where": ", ".join(item["where"]) or "no rotation beyond chance",
                }
                for item in found["candidates"][:SHOWN_CANDIDATES]
            ]
            heads = {
                "effect": "Effect", "before": "Without", "after": "With", "control": "With its control",
                "where": "Beyond chance on",
            }  # fmt: skip
            ui.table(
                rows=rows,
                columns=[
                    {"name": key, "label": label, "field": key, "align": "left"}
                    for key, label in heads.items()
                ],
                row_key="effect",
            ).props("flat dense").classes("finding-table")

    def _actions(self, found: Mapping[str, Any]) -> None:
        for action in found["actions"]:
            with ui.element("section").classes("finding"):
                ui.label(action["sentence"])
                if action["effect"] and action["saves"]:
                    ui.button(
                        f"Add {action['effect']}",
                        on_click=partial(self._add, action["effect"], [action["rotation"]]),
                    ).props("outline no-caps").classes("studio-target")

    def _unjudged(self, found: Mapping[str, Any]) -> None:
        if not found["not_identifiable"]:
            return
        with ui.expansion("What these takes could not show, and why").classes("finding"):
            for item in found["not_identifiable"]:
                ui.label(f"{item['effect']}: {item['why']}")
