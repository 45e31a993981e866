"""What is kept of one person: all of it as a file."""

from __future__ import annotations

from urllib.parse import quote

from nicegui import ui
from nicegui.events import ValueChangeEventArguments

from glovecal_service.rest.subject.answer import Subject
from glovecal_service.studio.heading import heading
from glovecal_service.studio.service import Service


class PersonalData:
    """One section of a page; nothing without a subject."""

    def __init__(self, service: Service) -> None:
        self._service = service

    async def build(self, person: str) -> None:
        """``person``: whom the page is about, "" for nobody."""
        names = [each.name for each in await self._service.read(list[Subject], "/subjects")]
        if not names:
            return
        with ui.element("section").classes("tree hand-sizes").props('aria-label="Personal data"'):
            heading(2, "Personal data")
            ui.label(
                "Everything that is kept of a person as one zip file: takes, recordings, videos, models, "
                "jobs and who changed what, with a README."
            )
            self._subject = ui.select(
                names, value=person if person in names else names[0], label="Whose", on_change=self._show
            ).classes("choice")
            self._acts = ui.element("div").classes("page-acts")
        self._show()

    def _show(self, _: ValueChangeEventArguments | None = None) -> None:
        name = str(self._subject.value)
        self._acts.clear()
        with self._acts:
            ui.link(f"Export all data of {name}", f"../v1/subjects/{quote(name)}/export").classes(
                "studio-link"
            )
