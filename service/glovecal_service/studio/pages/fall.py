"""Error fall: from the simplest calibration through each effect to the noise floor; undo the last step."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any
from urllib.parse import quote

from nicegui import ui

from glovecal_service.studio.amounts import made_of
from glovecal_service.studio.charts.fall_chart import FallChart
from glovecal_service.studio.hand.hand_view import HandView, Side
from glovecal_service.studio.hand.replay import Replay
from glovecal_service.studio.heading import heading
from glovecal_service.studio.job_watch import JobWatch
from glovecal_service.studio.pages.model_select import model_select
from glovecal_service.studio.service import Refusal
from glovecal_service.studio.shell import page, shell
from glovecal_service.studio.studio import Studio

EVERY_S = 1.0
CHANGES = ("add_effect", "remove_effect", "improve")
"""Jobs that make versions."""
REPLAYED_FRAMES = 400
SIDES: tuple[tuple[Side, str], ...] = (("back", "Back"), ("palm", "Palm"), ("side", "Side"))


def add(studio: Studio) -> None:
    """``/studio/fall``."""

    @page("/fall")
    async def fall(model: str = "") -> None:
        with shell(studio, "fall", "Error fall"):
            ui.add_head_html('<link rel="stylesheet" href="/studio/static/compare.css">')
            ui.add_head_html('<link rel="stylesheet" href="/studio/static/findings.css">')
            await FallPage(studio, model).build()


class FallPage:
    """One open page: the line of descent of one model."""

    def __init__(self, studio: Studio, model: str) -> None:
        self._studio = studio
        self._service = studio.service
        self._model = model
        self._growing = ""
        """The job that makes the next version, while it runs."""
        self._chart: FallChart | None = None

    async def build(self) -> None:
        model = await model_select(self._service, self._model, self._choose)
        if model is None:
            return
        self._model = model
        self._watch = JobWatch(self._studio, self._finished)
        self._shown = ui.element("div").classes("findings")
        await self._show()
        ui.timer(EVERY_S, self._look)

    async def _choose(self, model: str) -> None:
        self._model = model
        await self._show()

    async def _show(self) -> None:
        line = list(reversed(await self._service.get(f"/models/{self._model}/lineage")))
        self._subject, self._line = line[0]["subject"], line
        self._shown.clear()
        self._chart = None
        try:
            found = await self._service.get(f"/models/{self._model}/fall")
        except Refusal as refusal:
            with self._shown:
                ui.label(str(refusal)).classes("finding-sentence")
            return
        undone = await self._undone()
        with self._shown:
            ui.label(found["sentence"]).classes("finding-sentence")
            with ui.element("section").classes("finding"):
                heading(2, "How the error falls")
                self._chart = FallChart(label=f"Held-out error of each step. {found['sentence']}").classes(
                    "fall"
                )
                self._chart.show(found)
                ui.label(f"Root mean square over all rotations. {found['how']}").classes("fall-how")
                with ui.element("div").classes("page-acts"):
                    self._acts(line)
            if undone:
                with ui.element("section").classes("finding"):
                    heading(2, "Tried and not kept")
                    for sentence in undone:
                        ui.label(sentence)
            if len(line) > 1 and found["takes"]:
                await self._hands(line, [take["id"] for take in found["takes"]])

    def _acts(self, line: Sequence[Mapping[str, Any]]) -> None:
        last = line[-1]
        if last["effects"]:
            effect = last["effects"][-1]
            ui.button(f"Take {effect} out", on_click=partial(self._take_out, effect)).props(
                "outline no-caps"
            ).classes("studio-target")
        ui.link("What is still missing? Diagnose", f"/diagnose?model={last['id']}").classes("studio-link")
        ui.link("Compare the versions", _compared(line)).classes("studio-link")
        ui.link("See it live", "/live").classes("studio-link")

    async def _undone(self) -> list[str]:
        """Why a step of this line was undone."""
        ids = {each["id"] for each in self._line}
        found = []
        for job in await self._service.get("/jobs", subject=self._subject):
            if job["state"] != "done":
                continue
            if job["kind"] == "improve":
                result = (await self._service.get(f"/jobs/{job['id']}"))["result"]
                if ids & {step["model"] for step in result["steps"]}:
                    found += [item["sentence"] for item in result["undone"]]
            elif (
                job["kind"] == "add_effect" and job["payload"]["model"] in ids and not job["result"]["added"]
            ):
                found.append(job["result"]["sentence"])
        return list(dict.fromkeys(found))

    # Before and after

    async def _hands(self, line: Sequence[Mapping[str, Any]], takes: Sequence[str]) -> None:
        skeleton = await self._service.get(f"/subjects/{quote(self._subject)}/skeleton")
        with ui.element("section").classes("finding"):
            heading(2, "The worst stretch, before and after")
            sentence = ui.label("Looking for the worst stretch …").props('role="status"')
            views = []
            with ui.element("div").classes("compare-pair"):
                for name, model in (("Before", line[-2]), ("After", line[-1])):
                    with ui.element("div"):
                        heading(3, f"{name}: {made_of(model)}")
                        views.append(
                            HandView(
                                skeleton,
                                label=f"{name}: predicted hand, and the measured one as its ghost",
                                seen_from="side",
                                empty="",
                            ).classes("fall-hand")
                        )
            replay = Replay(views[0], views[1])
            with ui.row().classes("glove-sides"):
                for side, name in SIDES:
                    ui.button(name, on_click=partial(_look_from, views, side)).props(
                        "outline no-caps"
                    ).classes("studio-target")
            ui.label("Grey: predicted. Green, translucent: measured. Red: from fingertip to fingertip.")
        ui.timer(0.0, partial(self._replay, line, list(takes), replay, sentence), once=True)

    async def _replay(
        self, line: Sequence[Mapping[str, Any]], takes: list[str], replay: Replay, sentence: ui.label
    ) -> None:
        before, after = (each["id"] for each in line[-2:])
        try:
            where = await self._service.post(f"/models/{before}/where", {"takes": takes})
            if not where["stretches"]:
                sentence.set_text("No stretch stands out: nothing to replay.")
                return
            worst = where["stretches"][0]
            take = takes[worst["number"]]
            asked = {"takes": [take], "rotation": worst["rotation"], "points": 100}
            [own] = (await self._service.post(f"/models/{before}/series", asked))["takes"]
            body = {
                "take": take, "from_s": worst["start_s"], "to_s": worst["end_s"], "frames": REPLAYED_FRAMES,
            }  # fmt: skip
            both = await asyncio.gather(
                *(self._service.post(f"/models/{each}/replay", body) for each in (before, after))
            )
        except Refusal as refusal:
            sentence.set_text(f"No replay: {refusal}")
            return
        start = own["start_s"]
        replay.show(both[0], start_s=start, beside=both[1])
        begin, end = worst["start_s"] - start, worst["end_s"] - start
        sentence.set_text(
            f"{begin:.1f} to {end:.1f} s of take {worst['take']}, where the version before was worst: "
            f"{worst['rotation']} {worst['rotation_rmse_deg']:.1f} degrees RMS."
        )

    # What changes

    async def _take_out(self, effect: str) -> None:
        try:
            job = await self._service.delete(f"/models/{self._model}/effects/{quote(effect)}")
        except Refusal as refusal:
            ui.notify(str(refusal), type="warning")
            return
        self._grow(job)

    async def _look(self) -> None:
        """A version that is being made grows in the chart."""
        if self._growing or self._chart is None:
            await self._grow_on()
            return
        ids = {each["id"] for each in self._line}
        for job in await self._service.get("/jobs", subject=self._subject, only_unfinished=True):
            own = job["payload"].get("model") in ids or job["kind"] == "improve"
            if job["kind"] in CHANGES and own:
                self._grow(job)
                return

    def _grow(self, job: Mapping[str, Any]) -> None:
        self._growing = job["id"]
        self._watch.follow(job["id"])
        if self._chart is not None:
            self._chart.grow(_next_label(job), job["fraction"])

    async def _grow_on(self) -> None:
        if not self._growing or self._chart is None:
            return
        job = await self._service.get(f"/jobs/{self._growing}")
        if job["finished_at"] is None:
            self._chart.grow(_next_label(job), job["fraction"])

    async def _finished(self, job: Mapping[str, Any]) -> None:
        self._growing = ""
        if self._chart is not None:
            self._chart.stand()
        result = job["result"] if job["state"] == "done" else None
        made = None if result is None else result.get("model") or _last_model(result)
        if made is not None:
            ui.navigate.to(f"/fall?model={made}")
        else:
            await self._show()


def _next_label(job: Mapping[str, Any]) -> str:
    sign = "−" if job["kind"] == "remove_effect" else "+"
    return f"{sign} {job['payload'].get('effect', 'next effect')}"


def _last_model(result: Mapping[str, Any]) -> str | None:
    """Of an improvement."""
    steps = result.get("steps") or []
    return steps[-1]["model"] if steps else None


def _compared(line: Sequence[Mapping[str, Any]]) -> str:
    """A link to the newest two versions, the newer one first."""
    return f"/compare?models={','.join(each['id'][:12] for each in reversed(line[-2:]))}"


def _look_from(views: Sequence[HandView], side: Side) -> None:
    for view in views:
        view.look(side)
