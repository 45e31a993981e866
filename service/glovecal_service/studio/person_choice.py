"""Whose: a choice of one person, or of several, also where there are more than a list can offer."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from urllib.parse import quote

from nicegui import ui
from nicegui.events import GenericEventArguments, ValueChangeEventArguments

from glovecal_service.rest.subject.answer import Subject
from glovecal_service.studio.service import Refusal, Service, refusals

MOST_OFFERED = 100
TYPED_MS = 300


class People:
    """Names to choose from: all; where there are more, the first ones, and those that hold what is typed."""

    def __init__(self, service: Service, names: Sequence[str], *, are_all: bool) -> None:
        self._service = service
        self.names = tuple(names)
        self.are_all = are_all

    @classmethod
    async def of(cls, service: Service) -> People:
        """As they are now."""
        part = await service.part(Subject, "/subjects", limit=MOST_OFFERED)
        return cls(service, [each.name for each in part.rows], are_all=part.after is None)

    async def has(self, name: str) -> bool:
        """Whether there is somebody of that name."""
        if self.are_all or name in self.names:
            return name in self.names
        try:
            await self._service.get(f"/subjects/{quote(name, safe='')}")
        except Refusal as refusal:
            if refusal.status in (404, 422):
                return False
            raise
        return True

    def and_also(self, name: str) -> People:
        """The same where ``name`` is offered too; "" for nobody."""
        if not name or name in self.names:
            return self
        return People(self._service, (*self.names, name), are_all=self.are_all)

    def select(
        self,
        label: str,
        value: str | list[str] | None,
        on_change: Callable[[ValueChangeEventArguments], object] | None = None,
        *,
        multiple: bool = False,
        may_be_new: bool = False,
    ) -> ui.select:
        """``may_be_new``: what is typed may be the name of somebody who is to be added."""
        select = ui.select(
            list(self.names), value=value, label=label, on_change=on_change, multiple=multiple,
            with_input=may_be_new or not self.are_all, new_value_mode="add-unique" if may_be_new else None,
        )  # fmt: skip
        if not self.are_all:
            select.props(f"input-debounce={TYPED_MS}")
            select.on("input-value", lambda event: self._look_for(select, event))
        return select.classes("choice")

    def choose(self, select: ui.select, *chosen: str) -> None:
        """Whether or not they are in its list now."""
        value = list(chosen) if select.multiple else next(iter(chosen), None)
        select.set_options(list(dict.fromkeys([*chosen, *self.names])), value=value)

    async def _look_for(self, select: ui.select, event: GenericEventArguments) -> None:
        typed = str(event.args or "").strip()
        with refusals():
            part = await self._service.part(Subject, "/subjects", limit=MOST_OFFERED, text=typed)
            chosen = select.value if isinstance(select.value, list) else [select.value]
            kept = [name for name in chosen if name]
            select.set_options(list(dict.fromkeys([*kept, *(each.name for each in part.rows)])))
