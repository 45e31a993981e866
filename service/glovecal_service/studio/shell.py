"""What every page has around it: navigation, a heading, the drawer of jobs, notices of refusals."""

from __future__ import annotations

import json
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass
from functools import partial
from urllib.parse import quote

from nicegui import ui

from glovecal_service.rest.job.answer import JobRow
from glovecal_service.rest.model.answer import Model
from glovecal_service.studio.chosen import Chosen, chosen
from glovecal_service.studio.drop import DropZone
from glovecal_service.studio.heading import heading, quiet_act
from glovecal_service.studio.next_steps import NextStepLine, next_steps
from glovecal_service.studio.repeating import again
from glovecal_service.studio.service import Service, has_session, refusals
from glovecal_service.studio.studio import Studio

NAVIGATION = (
    ("start", "Start"),
    ("live", "Live"),
    ("capture", "Capture"),
    ("cameras", "Cameras"),
    ("takes", "Takes"),
    ("compare", "Compare"),
    ("diagnose", "Diagnose"),
    ("fall", "Error fall"),
    ("models", "Models"),
    ("effects", "Effects"),
)
"""Address below ``/studio`` and name of each page, in the order of the walk."""


PATIENCE_S = 60.0
"""A busy computer takes longer than the library's three seconds to ask for all that stands on a page."""
page = partial(ui.page, response_timeout=PATIENCE_S)
"""Registers the page of an address below ``/studio``."""


@dataclass(frozen=True)
class Around:
    """What a page has around it."""

    drop: DropZone
    chosen: Chosen
    _header: Header
    _line: NextStepLine

    async def model(self, service: Service) -> Model | None:
        """The one that is chosen; where there is none, what to do next is shown."""
        if self.chosen.model is None:
            whose = f" of {self.chosen.person}" if self.chosen.person else ""
            ui.label(f"No model{whose} yet.").classes("studio-notice")
            await next_steps(service, self.chosen)
        return self.chosen.model

    async def is_now_about(self, person: str) -> None:
        """Whose takes or model came in stands in the header, its links, the address and the next step."""
        about = self.chosen.of_person(person)
        with self._header.place:  # whoever says it may stand in a place that is gone
            self._header.show(about)
        await self._line.look(about)


class Header:
    """Navigation, and who and which model a page is about."""

    def __init__(self, here: str, title: str, *, about_models: bool) -> None:
        self._here, self._title, self._about_models = here, title, about_models
        with ui.element("nav").props('aria-label="Pages"').classes("studio-nav") as self.place:
            pass
        ui.space()
        self._choice = ui.element("div").classes("studio-chosen")
        self._shown: str | None = None

    def show(self, about: Chosen) -> None:
        ui.page_title(" – ".join(filter(None, (about.person, self._title, "Glovecal"))))
        if self._shown not in (None, about.person):
            ui.run_javascript(
                f"history.replaceState(null, '', '?' + {_KEEP_WHO}({json.dumps(about.person)}))"
            )
        self._shown = about.person
        self.place.clear()
        with self.place:
            for address, name in NAVIGATION:
                link = ui.link(name, about.address(address)).classes("studio-link")
                if address == self._here:
                    link.props('aria-current="page"')
        self._choice.clear()
        with self._choice:
            about.selects(self._here, about_models=self._about_models)


_KEEP_WHO = """(who => { const kept = new URLSearchParams(location.search);
  kept.set("who", who); kept.delete("model"); return kept; })"""


@asynccontextmanager
async def shell(
    studio: Studio, here: str, title: str, *, about_models: bool = False
) -> AsyncIterator[Around]:
    """A page: what stands in the ``with`` block is its main part; files dropped on it are looked at.

    ``about_models``: whether its header offers the person's models, not only persons.
    """
    about = await chosen(studio.service)
    ui.add_head_html('<link rel="stylesheet" href="/studio/static/studio.css">')
    for script in ("words", "tables"):
        ui.add_head_html(f'<script type="module" src="/studio/static/{script}.js"></script>')
    with ui.header(elevated=False).classes("studio-header"):
        ui.link("Skip to content", "#main").classes("studio-skip")
        ui.label("Glovecal").classes("studio-name")
        header = Header(here, title, about_models=about_models)
        header.show(about)
        if has_session():
            quiet_act("Log out", _log_out)
        drawer = JobsDrawer(studio)
    with ui.element("div").props('id="main" tabindex="-1"').classes("studio-main"):
        heading(1, title)
        if about.notice:
            ui.label(about.notice).classes("studio-notice").props('role="status"')
        line = NextStepLine(studio.service, about, here)
        await line.look()
        yield Around(DropZone(studio, about), about, header, line)
    drawer.start(line.look)


def _log_out() -> None:
    ui.run_javascript(_LOG_OUT)


_LOG_OUT = """await fetch("../login", {method: "DELETE"}); location = "../login?page=/studio/start";"""


# Jobs on every page: what runs and how far it is, cancel, result; what finished meanwhile is announced.


EVERY_S = 2.0
SHOWN = 12
WITH_REPORTS = ("improve", "detectability", "calibration-report")
PAGES = {"diagnose": ("diagnose?model=", "What it found"), "ceiling": ("compare?models=", "Compare")}
"""Where a job's model is shown with its result; of other kinds its errors are."""


def result_link(job: JobRow) -> tuple[str, str] | None:
    """Name and address of the page that shows what a finished job found; None where there is none."""
    if job.has_result and job.kind in WITH_REPORTS:
        return "Report", f"../v1/jobs/{job.id}/report"
    if not job.model:
        return None
    page, name = PAGES.get(job.kind, ("fall?model=", "Its errors"))
    return name, f"/{page}{quote(job.model)}"


class JobsDrawer:
    """A button in the header with the number of running jobs, and the list behind it."""

    def __init__(self, studio: Studio) -> None:
        self._studio = studio
        self._running: dict[str, tuple[str, float, str]] | None = None
        self._button = (
            ui.button("Jobs", on_click=lambda: self._dialog.open())
            .props('flat no-caps aria-haspopup="dialog"')
            .classes("studio-target")
        )
        with (
            ui.dialog().props('position="right" aria-label="Jobs"') as self._dialog,
            ui.card().classes("jobs"),
        ):
            heading(2, "Jobs")
            self._list = ui.column().classes("jobs-list")
            ui.link("All jobs", "/jobs").classes("studio-link")
            quiet_act("Close", self._dialog.close)

    def start(self, ended: Callable[[], Awaitable[None]]) -> None:
        """``ended`` is called after jobs have ended."""
        again(EVERY_S, partial(self._look, ended))

    async def _look(self, ended: Callable[[], Awaitable[None]]) -> None:
        service = self._studio.service
        running = await service.read(list[JobRow], "/jobs", only_unfinished=True)
        now = {job.id: (job.state, job.fraction, job.sentence) for job in running}
        if now == self._running:
            return
        jobs = await service.read(list[JobRow], "/jobs", limit=SHOWN)
        self._button.set_text(f"Jobs ({len(now)} running)" if now else "Jobs")
        for job in jobs:
            if self._running is not None and job.id in self._running and job.id not in now:
                ui.notify(f"{job.kind}: {job.state}", position="bottom-right")
        if set(self._running or ()) - set(now):
            await ended()
        self._running = now
        self._list.clear()
        with self._list:
            for job in jobs:
                self._row(job)
            if not jobs:
                ui.label("No job yet.")

    def _row(self, job: JobRow) -> None:
        with ui.element("section").classes("job"):
            about = f" of {job.subject}" if job.subject else ""
            ui.label(f"{job.kind}{about}: {job.state}").classes("job-kind")
            if job.finished_at is None:
                share = job.fraction
                ui.linear_progress(share, show_value=False).props(f'aria-label="{job.kind}"')
                quiet_act("Cancel", lambda: self._cancel(job.id))
            ui.label(job.sentence).classes("job-sentence")
            link = result_link(job)
            if link is not None:
                name, address = link
                ui.link(name, address).classes("studio-link")

    async def _cancel(self, job: str) -> None:
        with refusals():
            await self._studio.service.post(f"/jobs/{job}/cancel")
