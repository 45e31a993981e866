"""People who log in, on the page of keys: who may do what, with a password or by a provider."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from functools import partial
from typing import get_args
from urllib.parse import urlsplit

from nicegui import ui

from glovecal_client.site.roles import Role
from glovecal_service.rest.access.answer import Key, Person
from glovecal_service.studio.amounts import moment
from glovecal_service.studio.heading import act, heading, main_act
from glovecal_service.studio.person_choice import People
from glovecal_service.studio.service import Service, refusals, warn_long
from glovecal_service.studio.table import cell, row_head, table

MAY = {
    "viewer": "looks",
    "operator": "also records",
    "trainer": "also trains and activates",
    "admin": "does everything",
}


class ScopeChoice:
    """Fields for a role and whose takes and models are seen."""

    def __init__(self, subjects: People) -> None:
        self._role = ui.select(
            {role: f"{role}: {MAY[role]}" for role in get_args(Role)}, value="viewer", label="Role"
        ).classes("choice")
        self._of = subjects
        self._subjects = subjects.select("Of whom (nobody: of everybody)", [], multiple=True)

    def show(self, row: Key) -> None:
        self._role.set_value(row.role)
        self._of.choose(self._subjects, *(row.subjects or []))

    @property
    def body(self) -> dict[str, object]:
        """As REST takes it."""
        return {"role": self._role.value, "subjects": self._subjects.value or None}


class PeopleTable:
    """Who logs in with a password; ``changed`` is awaited after each change."""

    def __init__(self, service: Service, subjects: People, changed: Callable[[], Awaitable[None]]) -> None:
        self._service, self._changed = service, changed
        heading(2, "People")
        ui.label(
            "Whoever is here logs in to the studio with a name and a password, and changes it there. People "
            "of a provider are here once they have logged in; it gives their role."
        )
        with ui.row().classes("choices"):
            self._name = ui.input("Name of the person")
            self._scope = ScopeChoice(subjects)
            self._password = _password_input("Password, at least 12 characters")
        with ui.element("div").classes("page-acts"):
            main_act("Add the person", self._add)
        self._message = ui.label().props('aria-live="polite"')
        self._rows = ui.element("div")
        with (
            ui.dialog().props('aria-label="Change a person"') as self._dialog,
            ui.card().classes("person-change"),
        ):
            self._whom = heading(2, "")
            self._new_scope = ScopeChoice(subjects)
            self._new_password = _password_input("New password (empty: no change)")
            with ui.row():
                act("Change", self._change)
                act("Cancel", self._dialog.close)
        self._chosen: Person | None = None

    async def look(self) -> None:
        people = await self._service.every(Person, "/people")
        self._rows.clear()
        with self._rows:
            if not people:
                ui.label("Nobody yet.")
                return
            with table("People", ("Person", "Role", "Of", "Logs in", "")):
                for person in people:
                    self._row(person)

    def _row(self, person: Person) -> None:
        with ui.element("tr"):
            row_head(person.name)
            cell(person.role)
            cell(person.sees)
            cell(_login(person))
            with ui.element("td"):
                if person.revoked_at is None:
                    act(f"Change {person.name}", partial(self._open, person))
                    act(f"Remove {person.name}", partial(self._remove, person.name))
                else:
                    ui.label(f"removed {moment(person.revoked_at)}")

    def _open(self, person: Person) -> None:
        self._chosen = person
        self._whom.set_text(f"Change {person.name}")
        self._new_scope.show(person)
        self._new_password.set_value("")
        self._new_password.set_visibility(person.issuer is None)
        self._dialog.open()

    async def _add(self) -> None:
        body = {"name": self._name.value, "password": self._password.value, **self._scope.body}
        with refusals(self._message.set_text):
            await self._service.post("/people", body)
            self._message.set_text(f"{self._name.value} is added, and may log in.")
            self._name.set_value("")
            self._password.set_value("")
            await self._changed()

    async def _change(self) -> None:
        person, password = self._chosen, self._new_password.value
        assert person is not None
        self._dialog.close()
        self._new_password.set_value("")
        is_other = self._new_scope.body != {"role": person.role, "subjects": person.subjects}
        if not (is_other or password):
            self._message.set_text("Nothing was changed.")
            return
        with refusals(self._message.set_text):
            if is_other:
                await self._service.put(f"/people/{person.name}", self._new_scope.body)
            if password:
                await self._service.put(f"/people/{person.name}/password", {"password": password})
            self._message.set_text(f"{person.name} is changed, and logs in again.")
        with refusals(warn_long):
            await self._changed()

    async def _remove(self, name: str) -> None:
        with refusals(self._message.set_text):
            await self._service.delete(f"/people/{name}")
            self._message.set_text(f"{name} is removed, and logs in no more.")
            await self._changed()


def _login(person: Person) -> str:
    if person.password_changed_at is None:
        return f"at {urlsplit(person.issuer or '').hostname}"
    return f"with a password of {moment(person.password_changed_at)}"


def _password_input(label: str) -> ui.input:
    return ui.input(label, password=True).props('autocomplete="new-password"').classes("choice")
