"""A list that may be long: the newest rows first, those that hold the words of a filter, a part at a time."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from typing import Generic, TypeVar

from nicegui import ui

from glovecal_service.studio.heading import quiet_act
from glovecal_service.studio.service import Part, Service, refusals

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
        self._text = ""
        self._turned: list[str] = []
        """Where each part began that was turned to, the one that is shown last."""
        self._next: str | None = None
        self._shown: object = None

    async def build(self) -> None:
        with ui.row().classes("list-head"):
            field = ui.input(f"Filter {self._what}", on_change=lambda event: self._filter(event.value or ""))
            field.props(f"dense clearable debounce={TYPED_MS} maxlength=200").classes("list-filter")
            self._count = ui.label("").props('role="status"')
            self._newer = quiet_act("Newer", self._turn_back)
            self._older = quiet_act("Older", self._turn_on)
        self._place = ui.element("div")
        await self.look()

    async def look(self) -> bool:
        """Draw what is there now, where that is something else; whether there is anything."""
        asked = (*self._turned, self._text)
        part = await self._service.part(
            self._kind, self._path, reverse=self._path != "/jobs", limit=self._at_once,
            after=self._turned[-1] if self._turned else None, text=self._text,
        )  # fmt: skip
        if asked != (*self._turned, self._text):  # turned or typed meanwhile, which looks by itself
            return True
        now = (asked, part.total, part.after, [self._key(row) for row in part.rows])
        if now != self._shown:
            self._shown, self._next = now, part.after
            self._tell(part)
            self._place.clear()
            with self._place:
                await self._show(part.rows)
        return bool(part.rows)

    def _tell(self, part: Part[Row]) -> None:
        count = len(part.rows)
        first = self._at_once * len(self._turned) + 1
        of_all = "" if part.total is None else f" of {part.total:,}"
        some = f"{first:,} to {first + count - 1:,}{of_all}" if count else f"none{of_all}"
        is_whole = part.after is None and not self._turned
        self._count.set_text(f"{count}" if is_whole and count else some)
        self._newer.set_visibility(bool(self._turned))
        self._older.set_visibility(part.after is not None)

    async def _turn_on(self) -> None:
        if self._next is not None:
            self._turned.append(self._next)
            await self._look_anew()

    async def _turn_back(self) -> None:
        if self._turned:
            self._turned.pop()
            await self._look_anew()

    async def _filter(self, text: str) -> None:
        self._text = text.strip()
        self._turned.clear()
        await self._look_anew()

    async def _look_anew(self) -> None:
        with refusals():
            await self.look()
