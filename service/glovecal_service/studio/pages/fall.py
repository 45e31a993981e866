"""Error fall: from the simplest calibration through each effect to the noise floor; undo the last step."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence
from functools import partial
from typing import Any
from urllib.parse import quote

from nicegui import ui

from glovecal_models.comparison.series.answer import Series
from glovecal_models.comparison.where.answer import WhereItFails
from glovecal_models.improvement.answer import EffectAdded, Improved
from glovecal_models.improvement.fall.answer import ErrorFall
from glovecal_service.plain import read
from glovecal_service.rest.job.answer import Job, JobFacts, JobRow
from glovecal_service.rest.model.answer import Model, ReplayView
from glovecal_service.studio.amounts import made_of
from glovecal_service.studio.charts.chart import FallChart
from glovecal_service.studio.hand.hand_view import HandView, Replay, side_buttons
from glovecal_service.studio.heading import act, heading
from glovecal_service.studio.hidden_walk import HiddenWalk
from glovecal_service.studio.job_watch import JobWatch
from glovecal_service.studio.repeating import again, soon
from glovecal_service.studio.service import Refusal, refusals
from glovecal_service.studio.shell import page, shell
from glovecal_service.studio.studio import Studio

EVERY_S = 1.0
CHANGES = ("add_effect", "remove_effect", "improve")
"""Jobs that make versions."""
REPLAYED_FRAMES = 400


def add(studio: Studio) -> None:
    """``/studio/fall``."""

    @page("/fall")
    async def fall() -> None:
        async with shell(studio, "fall", "Error fall", about_models=True) as around:
            ui.add_head_html('<link rel="stylesheet" href="/studio/static/compare.css">')
            ui.add_head_html('<link rel="stylesheet" href="/studio/static/findings.css">')
            if model := await around.model(studio.service):
                await FallPage(studio, model.id).build()


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
        self._walk = HiddenWalk(self._service)
        self._watch = JobWatch(self._studio, self._finished)
        self._shown = ui.element("div").classes("findings")
        await self._show()
        again(EVERY_S, self._look)

    async def _show(self) -> None:
        line = (await self._service.read(list[Model], f"/models/{self._model}/lineage"))[::-1]
        self._subject, self._line = line[0].subject, line
        await self._walk.show(self._model)
        self._shown.clear()
        self._chart = None
        try:
            found = await self._service.read(ErrorFall, f"/models/{self._model}/fall")
        except Refusal as refusal:
            with self._shown:
                ui.label(str(refusal)).classes("finding-sentence")
            return
        undone = await self._undone()
        with self._shown:
            ui.label(found.sentence).classes("finding-sentence")
            with ui.element("section").classes("finding"):
                heading(2, "How the error falls")
                self._chart = FallChart(label=f"Held-out error of each step. {found.sentence}").classes(
                    "fall"
                )
                self._chart.show(found.steps, found.floor)
                ui.label(f"Root mean square over all rotations. {found.how}").classes("fall-how")
                with ui.element("div").classes("page-acts"):
                    self._acts(line)
            if undone:
                with ui.element("section").classes("finding"):
                    heading(2, "Tried and not kept")
                    for sentence in undone:
                        ui.label(sentence)
            if len(line) > 1 and found.takes:
                await self._hands(line, [take.id for take in found.takes])

    def _acts(self, line: Sequence[Model]) -> None:
        last = line[-1]
        if last.effects:
            effect = last.effects[-1]
            act(f"Take {effect} out", partial(self._take_out, effect))
        ui.link("What is still missing? Diagnose", f"/diagnose?model={last.id}").classes("studio-link")
        ui.link("Compare the versions", _compared(line)).classes("studio-link")
        ui.link("See it live", "/live").classes("studio-link")

    async def _undone(self) -> list[str]:
        """Why a step of this line was undone."""
        ids = {each.id for each in self._line}
        found = []
        for job in await self._service.every(JobRow, "/jobs", subject=self._subject, state="done"):
            if job.kind == "improve":
                walked = read(Improved, await self._result(job))
                if ids & {step.model for step in walked.steps}:
                    found += [item.sentence for item in walked.undone]
            elif job.kind == "add_effect" and job.payload.get("model") in ids:
                tried = read(EffectAdded, await self._result(job))
                found += [] if tried.added else [tried.sentence]
        return list(dict.fromkeys(found))

    async def _result(self, job: JobRow) -> dict[str, Any] | None:
        return (await self._service.read(Job, f"/jobs/{job.id}")).result

    # Before and after

    async def _hands(self, line: Sequence[Model], takes: Sequence[str]) -> None:
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
            side_buttons(*views)
            ui.label("Grey: predicted. Green, translucent: measured. Red: from fingertip to fingertip.")
        soon(partial(self._replay, line, list(takes), replay, sentence))

    async def _replay(
        self, line: Sequence[Model], takes: list[str], replay: Replay, sentence: ui.label
    ) -> None:
        before, after = (each.id for each in line[-2:])
        try:
            where = await self._service.ask(WhereItFails, f"/models/{before}/where", {"takes": takes})
            if not where.stretches:
                sentence.set_text("No stretch stands out: nothing to replay.")
                return
            worst = where.stretches[0]
            take = takes[worst.number]
            asked = {"takes": [take], "rotation": worst.rotation, "points": 100}
            [own] = (await self._service.ask(Series, f"/models/{before}/series", asked)).takes
            body = {
                "take": take, "from_s": worst.start_s, "to_s": worst.end_s, "frames": REPLAYED_FRAMES,
            }  # fmt: skip
            both = await asyncio.gather(
                *(self._service.ask(ReplayView, f"/models/{each}/replay", body) for each in (before, after))
            )
        except Refusal as refusal:
            sentence.set_text(f"No replay: {refusal}")
            return
        start = own.start_s
        replay.show(both[0], start_s=start, beside=both[1])
        begin, end = worst.start_s - start, worst.end_s - start
        sentence.set_text(
            f"{begin:.1f} to {end:.1f} s of take {worst.take}, where the version before was worst: "
            f"{worst.rotation} {worst.rotation_rmse_deg:.1f} degrees RMS."
        )

    # What changes

    async def _take_out(self, effect: str) -> None:
        with refusals():
            path = f"/models/{self._model}/effects/{quote(effect)}"
            job = read(JobFacts, await self._service.delete(path))
            self._grow(job)

    async def _look(self) -> None:
        """A version that is being made grows in the chart."""
        if self._growing or self._chart is None:
            await self._grow_on()
            return
        ids = {each.id for each in self._line}
        for job in await self._service.every(JobRow, "/jobs", subject=self._subject, only_unfinished=True):
            own = job.payload.get("model") in ids or job.kind == "improve"
            if job.kind in CHANGES and own:
                self._grow(job)
                return

    def _grow(self, job: JobFacts) -> None:
        self._growing = job.id
        self._watch.follow(job.id)
        if self._chart is not None:
            self._chart.grow(_next_label(job), job.fraction)

    async def _grow_on(self) -> None:
        if not self._growing or self._chart is None:
            return
        job = await self._service.read(Job, f"/jobs/{self._growing}")
        if job.finished_at is None:
            self._chart.grow(_next_label(job), job.fraction)

    async def _finished(self, job: Job) -> None:
        self._growing = ""
        if self._chart is not None:
            self._chart.stand()
        made = None
        if job.state == "done" and job.result is not None:
            made = read(Improved, job.result).last.model if job.kind == "improve" else job.result.get("model")
        if made is not None:
            ui.navigate.to(f"/fall?model={made}")
        else:
            await self._show()


def _next_label(job: JobFacts) -> str:
    sign = "−" if job.kind == "remove_effect" else "+"
    return f"{sign} {job.payload.get('effect', 'next effect')}"


def _compared(line: Sequence[Model]) -> str:
    """A link to the newest two versions, the newer one first."""
    return f"/compare?models={','.join(each.short for each in reversed(line[-2:]))}"
