"""The end of a guided sampling: what became of its steps, and what to do with its takes."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any

from nicegui import ui

from glovecal_service.studio.heading import heading
from glovecal_service.studio.job_watch import JobWatch
from glovecal_service.studio.served_label import ServedLabel
from glovecal_service.studio.service import Refusal
from glovecal_service.studio.studio import Studio

SECOND_WEARING = "second_wearing"

_checking: set[str] = set()
"""Samplings whose check is under way: two pages that show one end must not check twice."""


class SamplingEnd:
    """Of a sampling that is over and whose takes are stored."""

    def __init__(self, studio: Studio, view: Mapping[str, Any]) -> None:
        self._studio = studio
        self._view = view

    async def build(self) -> None:
        view = self._view
        good = sum(step["outcome"] == "good" for step in view["steps"])
        with ui.element("section").classes("card capture-end").props('aria-label="Result" tabindex="-1"'):
            heading(2, "Done" if view["phase"] == "done" else "Stopped")
            takes = "1 take" if len(view["takes"]) == 1 else f"{len(view['takes'])} takes"
            ui.label(
                f"{good} of {len(view['steps'])} steps are good, {takes} stored for {view['subject']}; "
                f"{view['capture_s']:.0f} s of capture."
            ).classes("finding-sentence").props('role="status"')
            for sentence in (*view["sentences"], view["problem"]):
                if sentence:
                    ui.label(sentence)
            self._left_open()
            with ui.element("div").classes("capture-acts"):
                if view["takes"] and view["protocol"] != SECOND_WEARING:
                    ui.button("Train a model", on_click=self._train).props(
                        "unelevated no-caps color=indigo-8 size=lg"
                    ).classes("studio-main-act")
                ui.link("New sampling", "/capture?mode=sampling").classes("studio-link")
            self._watch = JobWatch(self._studio, self._trained)
            self._after = ui.element("div").classes("findings").props('aria-live="polite"')
        if view["takes"] and view["protocol"] == SECOND_WEARING:
            await self._check()

    def _left_open(self) -> None:
        open_steps = [step for step in self._view["steps"] if step["outcome"] != "good"]
        if not open_steps:
            return
        with ui.expansion(f"Steps that are not good: {len(open_steps)}").classes("capture-steps"):
            for step in open_steps:
                ui.label(f"{step['name']}: {step['outcome'] or 'not done'}. {' '.join(step['reasons'])}")

    async def _train(self) -> None:
        try:
            worn = {"subject": self._view["subject"], "layout": self._view["layout"]}
            job = await self._studio.service.post("/models/train", worn | {"hand": await self._hand()})
        except Refusal as refusal:
            ui.notify(str(refusal), type="warning", timeout=10_000)
            return
        self._watch.follow(job["id"])

    async def _hand(self) -> str | None:
        """That its takes are of; None where capture does not know it."""
        takes = self._view["takes"]
        return (await self._studio.service.get(f"/takes/{takes[0]}"))["known_hand"] if takes else None

    async def _trained(self, job: Mapping[str, Any]) -> None:
        if job["state"] != "done":
            return
        with self._after, ui.element("div"):
            ServedLabel(self._studio, self._view["glove"], job["result"]["model"], "Trained")
            ui.link("See the hand live", "/live").classes("studio-link")
            ui.link("See its error", "/models").classes("studio-link")

    async def _check(self) -> None:
        """The active model learns the shift of this wearing; the child is served if that made it better."""
        id = self._view["id"]
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
        models = await service.get(
            "/models", subject=view["subject"], layout=view["layout"], hand=await self._hand()
        )
        if any(each["facts"].get("quick_check", {}).get("takes") == view["takes"] for each in models):
            with self._after:
                ui.label("This wearing is checked; its model is on the page Models.")
            return
        active = next((each["id"] for each in models if each["active"]), None)
        try:
            if active is None:
                raise Refusal(409, f"No model is active for {view['subject']}: there is nothing to check.")
            found = await service.post(
                f"/models/{active}/quick-check", {"takes": view["takes"], "activate": False}
            )
        except Refusal as refusal:
            with self._after:
                ui.label(str(refusal)).classes("studio-problem").props('role="alert"')
            return
        found_deg, left_deg = found["as_found_deg"], found["as_left_deg"]
        is_better = left_deg is not None and left_deg <= found_deg
        if is_better:
            await service.post(f"/models/{found['model']}/activate")
        with self._after, ui.element("section").classes("finding"):
            heading(2, f"Wearing {found['wearing']} is checked")
            if is_better:
                ServedLabel(self._studio, view["glove"], found["model"], "The model is checked")
            else:
                ui.label("The model stays as it was: its poses are not better after the check.").classes(
                    "finding-sentence"
                )
            for sentence in found["sentences"]:
                ui.label(sentence)
            if not is_better:
                ui.button("Use the checked model", on_click=partial(self._activate, found["model"])).props(
                    "outline no-caps"
                ).classes("studio-target")
            ui.link("See the hand live", "/live").classes("studio-link")

    async def _activate(self, model: str) -> None:
        try:
            await self._studio.service.post(f"/models/{model}/activate")
        except Refusal as refusal:
            ui.notify(str(refusal), type="warning")
            return
        with self._after:
            ServedLabel(self._studio, self._view["glove"], model, "The checked model is active")
