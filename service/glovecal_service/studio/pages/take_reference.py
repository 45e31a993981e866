"""The reference of a take: angles measured elsewhere, attached to it, and whether their clocks agree."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Mapping
from functools import partial
from pathlib import PurePosixPath
from typing import Any

from nicegui import ui

from glovecal_models.takes.answer import TakeClock
from glovecal_service.plain import read
from glovecal_service.rest.take.answer import Take
from glovecal_service.studio.file_button import FileButton
from glovecal_service.studio.heading import act, heading, quiet_act
from glovecal_service.studio.service import refusals
from glovecal_service.studio.studio import Studio

SHOWN_TAKES = 100
MEDIA_TYPES = {".parquet": "application/vnd.apache.parquet"}


class TakeReference:
    """Angles measured elsewhere, attached to a take; and whether their clock is the glove's."""

    def __init__(self, studio: Studio, changed: Callable[[str], Awaitable[None]]) -> None:
        """``changed`` is called with the id of a take that has another reference, or one moved in time."""
        self._studio = studio
        self._changed = changed

    async def build(self) -> None:
        with ui.element("section").classes("card capture-form").props('aria-label="Reference"'):
            heading(2, "Reference of a take")
            ui.label("A table with time_s and r. columns, CSV or Parquet, from another measuring system.")
            with ui.element("div").classes("capture-fields"):
                self._take = ui.select({}, label="Take").classes("choice")
                self._clock = ui.select(
                    {"take": "seconds as in the take", "wall": "Unix seconds"}, value="take",
                    label="Time column counts from",
                ).classes("choice")  # fmt: skip
            with ui.element("div").classes("capture-acts"):
                FileButton(
                    "Attach a file", suffixes=".csv,.parquet", largest=self._studio.largest_file,
                    take=self._attach, tell=lambda sentence: self._told.set_text(sentence),
                ).button.props("unelevated no-caps color=indigo-8").classes("studio-main-act")  # fmt: skip
                for name, repair in (("Check its clock", False), ("Check and move the reference", True)):
                    act(name, partial(self._check, repair))
                quiet_act("Undo the move", self._undo)
            self._told = ui.label("").classes("studio-notice").props('role="status"')
        await self._list()

    async def choose(self, take: str) -> None:
        await self._list()
        self._take.set_value(take)

    async def _list(self) -> None:
        takes = await self._studio.service.read(list[Take], "/takes", reverse=True, limit=SHOWN_TAKES)
        names = {
            each.id: f"{each.subject}: {each.name}" + (", with reference" if each.rotations else "")
            for each in takes
        }
        self._take.set_options(names, value=self._take.value if self._take.value in names else None)

    async def _attach(self, name: str, content: bytes) -> None:
        name = PurePosixPath(name).name
        kind = MEDIA_TYPES.get(PurePosixPath(name).suffix.lower(), "text/csv")
        if not self._take.value:
            self._told.set_text("Choose a take first.")
            return
        with refusals(self._told.set_text):
            document = await self._studio.service.put_file(
                f"/takes/{self._take.value}/reference", content, kind,
                clock=self._clock.value, filename=name,
            )  # fmt: skip
            await self._list()
            take = read(Take, document)
            self._told.set_text(
                f"{take.name} has {len(take.rotations)} measured rotations. Check its clock next."
            )
            await self._changed(take.id)

    async def _check(self, repair: bool) -> None:
        await self._ask_clock("/takes/clocks", {"repair": repair})

    async def _undo(self) -> None:
        await self._ask_clock("/takes/clocks/undo", {})

    async def _ask_clock(self, path: str, body: Mapping[str, Any]) -> None:
        if not self._take.value:
            self._told.set_text("Choose a take first.")
            return
        with refusals(self._told.set_text):
            found = await self._studio.service.post(path, {"takes": [self._take.value], **body})
            clocks = read(list[TakeClock | str], found)
            said = [
                each.sentence + (" Moved." if each.repaired else "")
                for each in clocks
                if isinstance(each, TakeClock)
            ]
            self._told.set_text(" ".join(said) or ("Moved back." if found else "Nothing was moved."))
            await self._changed(self._take.value)
