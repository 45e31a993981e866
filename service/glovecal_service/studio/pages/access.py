"""Keys, people and changes: who may do what, and who did."""

from __future__ import annotations

from functools import partial

from nicegui import ui

from glovecal_service.plain import read
from glovecal_service.rest.access.answer import AuditCheck, AuditRow, Key, NewKey
from glovecal_service.studio.amounts import moment
from glovecal_service.studio.heading import act, heading, main_act
from glovecal_service.studio.pages.people import PeopleTable, ScopeChoice
from glovecal_service.studio.person_choice import People
from glovecal_service.studio.service import refusals, warn_long
from glovecal_service.studio.shell import page, shell
from glovecal_service.studio.studio import Studio
from glovecal_service.studio.table import cell, row_head, table

SHOWN = 50
"""Changes, the newest."""


def add(studio: Studio) -> None:
    """``/studio/access``."""

    @page("/access")
    async def access() -> None:
        async with shell(studio, "access", "Keys, people and changes"):
            ui.add_head_html('<link rel="stylesheet" href="/studio/static/findings.css">')
            with refusals(warn_long):
                await AccessPage(studio).build()


class AccessPage:
    def __init__(self, studio: Studio) -> None:
        self._service = studio.service

    async def build(self) -> None:
        subjects = await People.of(self._service)
        heading(2, "Keys")
        ui.label(
            "Where others reach this service, each needs a key or a password; on this computer alone nobody "
            "is asked."
        )
        with ui.row().classes("choices"):
            self._name = ui.input("Name of the key")
            self._scope = ScopeChoice(subjects)
        with ui.element("div").classes("page-acts"):
            main_act("Make a key", self._make)
        self._told = ui.label().props('aria-live="polite"')
        self._made = ui.input("The key; it is not shown again").props("readonly").classes("choice")
        self._made.set_visibility(False)
        self._keys = ui.element("div")
        self._people = PeopleTable(self._service, subjects, self._look)
        heading(2, "Changes")
        with ui.element("div").classes("page-acts"):
            act("Look whether the log is what was written", self._check)
        self._checked = ui.label().props('aria-live="polite"')
        self._changes = ui.element("div")
        await self._look()

    async def _look(self) -> None:
        keys = await self._service.every(Key, "/keys")
        changes = await self._service.read(list[AuditRow], "/audit", limit=SHOWN)
        await self._people.look()
        self._keys.clear()
        with self._keys:
            if keys:
                with table("Keys", ("Key", "Role", "Of", "Made", "")):
                    for key in keys:
                        self._key_row(key)
            else:
                ui.label("No key yet.")
        self._changes.clear()
        with self._changes, table("Changes, the newest first", ("When", "Who", "From", "Asked", "Changed")):
            for change in changes:
                with ui.element("tr"):
                    row_head(moment(change.at))
                    cell(change.who)
                    cell(change.origin or "–")
                    cell(change.action or "–")
                    cell(", ".join(dict.fromkeys(f"{row['table']} {row['key']}" for row in change.changes)))

    def _key_row(self, key: Key) -> None:
        with ui.element("tr"):
            row_head(key.name)
            cell(key.role)
            cell(key.sees)
            cell(moment(key.created_at))
            with ui.element("td"):
                if key.revoked_at is None:
                    act(f"Revoke {key.name}", partial(self._revoke, key.name))
                else:
                    ui.label(f"revoked {moment(key.revoked_at)}")

    async def _make(self) -> None:
        body = {"name": self._name.value, **self._scope.body}
        with refusals(self._told.set_text):
            made = read(NewKey, await self._service.post("/keys", body))
            self._made.set_value(made.key)
            self._made.set_visibility(True)
            self._told.set_text(f"The key of {made.name} stands below, once: copy it now.")
            await self._look()

    async def _revoke(self, name: str) -> None:
        with refusals(self._told.set_text):
            await self._service.delete(f"/keys/{name}")
            self._told.set_text(f"Key {name} is revoked: it opens nothing any more.")
            await self._look()

    async def _check(self) -> None:
        with refusals(self._checked.set_text):
            check = await self._service.read(AuditCheck, "/audit/check")
            self._checked.set_text(
                f"{check.entries} entries, each as it was written."
                if not check.problems
                else f"It was changed: {'; '.join(check.problems[:10])}."
            )
