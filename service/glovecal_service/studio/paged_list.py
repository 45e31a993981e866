"""A list that may be long: the newest rows first, those that hold the words of a filter, a part at a time."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from typing import Generic, TypeVar

from nicegui import ui

from glovecal_service.studio.heading import quiet_act
from glovecal_service.studio.service import Service, refusals

Row = TypeVar("Row")
TYPED_MS = 300


class PagedList(Generic[Row]):
    """``show`` draws the rows of one part, inside the place of this list."""

    def __init__(
        self,
        service: Service,
        kind: type[Row],
        path: str,
        show: Callable[[list[Row]], Awaitable[None]],
        *,
        what: str,
        at_once: int,
        key: Callable[[Row], object] = lambda row: row,
    ) -> None:
        """``what``: rows of the list in the plural, such as ``takes``; ``key``: that of a row which, changed,
        is drawn anew."""
        self._service, self._kind, self._path = service, kind, path
        self._show, self._what, self._at_once = show, what, at_once
        self._key = key
        self._offset, self._text = 0, ""
        self._shown: object = None

    async def build(self) -> None:
        with ui.row().classes("list-head"):
            field = ui.input(f"Filter {self._what}", on_change=lambda event: self._filter(event.value or ""))
            field.props(f"dense clearable debounce={TYPED_MS} maxlength=200").classes("list-filter")
            self._count = ui.label("").props('role="status"')
            self._newer = quiet_act("Newer", lambda: self._turn(-self._at_once))
            self._older = quiet_act("Older", lambda: self._turn(self._at_once))
        self._place = ui.element("div")
        await self.look()

    async def look(self) -> bool:
        """Draw what is there now, where that is something else; whether there is anything."""
        asked = (self._offset, self._text)
        rows, total = await self._service.part(
            self._kind, self._path, reverse=self._path != "/jobs", limit=self._at_once,
            offset=self._offset, text=self._text,
        )  # fmt: skip
        if asked != (self._offset, self._text):  # turned or typed meanwhile, which looks by itself
            return True
        now = (asked, total, [self._key(row) for row in rows])
        if now != self._shown:
            self._shown = now
            self._tell(len(rows), total)
            self._place.clear()
            with self._place:
                await self._show(rows)
        return bool(rows)

    def _tell(self, rows: int, total: int) -> None:
        first = self._offset + 1
        some = f"{first:,} to {self._offset + rows:,} of {total:,}" if rows else f"none of {total:,}"
        self._count.set_text(some if total > self._at_once or not rows else f"{rows}")
        for button, is_there in (
            (self._newer, self._offset > 0),
            (self._older, self._offset + self._at_once < total),
        ):
            button.set_visibility(is_there)

    async def _turn(self, by: int) -> None:
        self._offset = max(0, self._offset + by)
        with refusals():
            await self.look()

    async def _filter(self, text: str) -> None:
        self._text, self._offset = text.strip(), 0
        with refusals():
            await self.look()
