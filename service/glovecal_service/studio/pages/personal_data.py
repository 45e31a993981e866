"""What is kept of one person: all of it as a file, and its erasure."""

from __future__ import annotations

from urllib.parse import quote

from nicegui import ui
from nicegui.events import ValueChangeEventArguments

from glovecal_service.rest.subject.answer import Erasure
from glovecal_service.studio.heading import act, heading, quiet_act
from glovecal_service.studio.person_choice import People
from glovecal_service.studio.service import Service, refusals


class PersonalData:
    """One section of a page; nothing without a subject."""

    def __init__(self, service: Service) -> None:
        self._service = service

    async def build(self, person: str) -> None:
        """``person``: whom the page is about, "" for nobody."""
        people = await People.of(self._service)
        if not people.names:
            return
        person = person if await people.has(person) else people.names[0]
        with ui.element("section").classes("tree hand-sizes").props('aria-label="Personal data"'):
            heading(2, "Personal data")
            ui.label(
                "Everything that is kept of a person as one zip file: takes, recordings, videos, models, "
                "jobs and who changed what, with a README. Erasing removes all of that."
            )
            self._subject = people.and_also(person).select("Whose", person, self._show)
            self._acts = ui.element("div").classes("page-acts")
            self._confirming = ui.element("div").classes("page-acts")
            with self._confirming:
                self._again = ui.input("Type the name to erase it for ever", on_change=self._typed)
                self._again.classes("choice")
                self._erase_act = act("Erase for ever", self._erase)
                quiet_act("Keep", self._show)
            self._told = ui.element("div").props('role="status"')
        self._show()

    @property
    def _name(self) -> str:
        return str(self._subject.value or "")

    @property
    def _is_confirmed(self) -> bool:
        return str(self._again.value or "").strip().lower() == self._name

    def _show(self, _: ValueChangeEventArguments | None = None) -> None:
        self._confirming.set_visibility(False)
        self._acts.clear()
        if self._name:
            with self._acts:
                address = f"../v1/subjects/{quote(self._name)}/export"
                ui.link(f"Export all data of {self._name}", address).classes("studio-link")
                quiet_act(f"Erase {self._name}", self._ask)

    def _ask(self) -> None:
        self._told.clear()
        self._again.set_value("")
        self._typed()
        self._confirming.set_visibility(True)

    def _typed(self, _: ValueChangeEventArguments | None = None) -> None:
        self._erase_act.set_enabled(self._is_confirmed)

    async def _erase(self) -> None:
        if not self._is_confirmed:
            return
        with refusals(lambda sentence: self._tell([sentence])):
            erased = await self._service.ask(Erasure, "/erasures", {"subject": self._name})
            self._tell(erased.sentences)
            people = await People.of(self._service)
            people.choose(self._subject, *people.names[:1])
            self._show()

    def _tell(self, sentences: list[str]) -> None:
        self._told.clear()
        with self._told:
            for sentence in sentences:
                ui.label(sentence)
