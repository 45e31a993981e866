"""A job's progress where it was begun: a bar, its sentence, cancel; then the page shows its result."""

from __future__ import annotations

from collections.abc import Awaitable, Callable

from nicegui import ui

from glovecal_service.rest.job.answer import Job
from glovecal_service.studio.heading import quiet_act
from glovecal_service.studio.repeating import again
from glovecal_service.studio.service import Refusal, refusals
from glovecal_service.studio.studio import Studio

EVERY_S = 0.5


class JobWatch:
    """One bar on a page, hidden while no job is followed. A page that is closed leaves its job running."""

    def __init__(
        self,
        studio: Studio,
        finished: Callable[[Job], Awaitable[None]],
        looked: Callable[[Job], None] | None = None,
    ) -> None:
        """``looked`` is given the job twice a second while it runs."""
        self._studio = studio
        self._finished = finished
        self._looked = looked
        self._job = ""
        self._row = ui.element("section").classes("job").props('aria-label="Running job"')
        with self._row:
            self._sentence = ui.label("").props('role="status"')
            self._bar = ui.linear_progress(0.0, show_value=False).props('aria-label="progress"')
            quiet_act("Cancel", self._cancel)
        self._row.set_visibility(False)
        self._timer = again(EVERY_S, self._look, active=False)

    def follow(self, job: str) -> None:
        self._job = job
        self._sentence.set_text("Waiting for a worker")
        self._bar.set_value(0.0)
        self._row.set_visibility(True)
        self._timer.activate()

    async def _look(self) -> None:
        try:
            job = await self._studio.service.read(Job, f"/jobs/{self._job}")
        except Refusal as refusal:
            self._end(str(refusal))
            return
        self._bar.set_value(job.fraction)
        self._sentence.set_text(f"{100 * job.fraction:.0f} %  {job.sentence}")
        if job.finished_at is None:
            if self._looked is not None:
                self._looked(job)
            return
        self._end("" if job.state == "done" else job.error or f"{job.kind}: {job.state}")
        await self._finished(job)

    def _end(self, problem: str) -> None:
        self._timer.deactivate()
        self._row.set_visibility(False)
        if problem:
            ui.notify(problem, type="warning", timeout=10_000)

    async def _cancel(self) -> None:
        with refusals():
            await self._studio.service.post(f"/jobs/{self._job}/cancel")
