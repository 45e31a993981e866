"""Jobs: long work of today and before, what it was about, how long it took and why it failed."""

from __future__ import annotations

from nicegui import ui

from glovecal_service.rest.job.answer import JobRow
from glovecal_service.studio.amounts import moment, seconds
from glovecal_service.studio.paged_list import PagedList
from glovecal_service.studio.repeating import again
from glovecal_service.studio.shell import page, result_link, shell
from glovecal_service.studio.studio import Studio
from glovecal_service.studio.table import cell, row_head, table

EVERY_S = 2.0
AT_ONCE = 40
HEADS = ("Job", "Person", "About", "Begun", "Took", "State", "Result")


def add(studio: Studio) -> None:
    """``/studio/jobs``."""

    @page("/jobs")
    async def jobs() -> None:
        async with shell(studio, "jobs", "Jobs"):
            ui.add_head_html('<link rel="stylesheet" href="/studio/static/findings.css">')
            every = PagedList(studio.service, JobRow, "/jobs", _show, what="jobs", at_once=AT_ONCE)
            await every.build()
            again(EVERY_S, every.look)


async def _show(jobs: list[JobRow]) -> None:
    with table("Jobs, the newest first", HEADS):
        for job in jobs:
            with ui.element("tr"):
                row_head(job.kind)
                cell(job.subject or "–")
                cell(job.about or "–")
                cell(moment(job.created_at))
                cell("–" if job.took_s is None else seconds(job.took_s))
                cell(job.state if job.error is None else f"{job.state}: {job.error}")
                with ui.element("td"):
                    found = result_link(job)
                    if found is not None:
                        ui.link(*found).classes("studio-link")
    if not jobs:
        ui.label("No job here.")
