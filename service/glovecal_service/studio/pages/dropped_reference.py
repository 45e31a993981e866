"""Angles of another measuring system that were dropped: what they are, and the take they are attached to."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from typing import Any

from nicegui import ui

from glovecal_models.presentation.document import first_of
from glovecal_models.takes.answer import ColumnMapping, TablePreview
from glovecal_service.rest.take.answer import PossibleTake, ReferencePreview, Take
from glovecal_service.studio.chosen import Chosen
from glovecal_service.studio.drop import Uploaded
from glovecal_service.studio.heading import heading, main_act
from glovecal_service.studio.pages.dropped_tables import ColumnsTable, read_as, uploaded
from glovecal_service.studio.pages.left_out import tell_left_out
from glovecal_service.studio.service import refusals, warn_long
from glovecal_service.studio.studio import Studio
from glovecal_service.studio.table import table, text_row

MOST_MADE_OF = 6
NOT_FOUND = "Movement does not tell which take it belongs to: choose one, and it is said when it begins."


class DroppedReference:
    """A table with angles and no readings, a TRC or a BVH file."""

    def __init__(
        self,
        studio: Studio,
        file: Uploaded,
        attached: Callable[[Take, Uploaded], Awaitable[None]],
        table_seen: TablePreview | None = None,
    ) -> None:
        """``attached`` is awaited with the take and the file."""
        self._studio = studio
        self.file = file
        self._attached = attached
        self._table = table_seen
        self._mapping = None if table_seen is None or table_seen.is_take_table else table_seen.mapping
        self._hand: str | None = None
        self._subject: ui.select | None = None
        self._take: ui.select | None = None
        self._act: ui.button | None = None

    @property
    def body(self) -> dict[str, Any]:
        """As requests name it."""
        mapping = {} if self._mapping is None else read_as(self._mapping)
        return uploaded(self.file) | {"hand": self._hand} | mapping

    async def build(self, about: Chosen, *, joined: Callable[[], Awaitable[None]] | None) -> None:
        """``joined``: with readings that came with it and are imported together with it, is awaited when it
        is read in another way. Raises Refusal where the file cannot be read; then nothing is shown."""
        self._joined = joined
        person = None if joined is not None or not about.person else about.person
        seen = await self._preview(person)
        with ui.element("section").classes("finding finding-named") as self._place:
            self._place.props["aria-label"] = f"Preview of {self.file[1]}"
            heading(2, self.file[1])
            self._sentence = ui.label("").classes("finding-sentence").props('role="status"')
            with ui.row().classes("choices"):
                if len(seen.hands) > 1:
                    self._side = ui.select(
                        list(seen.hands), value=seen.hand, label="Hand", on_change=self._other_hand
                    )
                if joined is not None:
                    ui.label("It is imported together with the readings.")
                elif about.people.names:
                    self._subject = about.people.select("Person", person, lambda _: self._other_person())
                    self._take = ui.select({}, label="Take", on_change=self._say_when).classes("choice")
                    self._act = main_act("Attach to the take", self._attach)
                else:
                    ui.label("There is no take that it could be of. Drop the readings too.")
            self._of_take = ui.label("").props('role="status"')
            self._facts = ui.element("div")
            if self._table is not None:
                with ui.expansion("Columns: how they are read").classes("preview-columns") as self._columns:
                    ColumnsTable(self._read_as).build(self._table)
        self._show(seen)

    async def _preview(self, person: str | None) -> ReferencePreview:
        body = self.body | {"subject": person}
        return await self._studio.service.ask(ReferencePreview, "/takes/references/preview", body)

    @property
    def _person(self) -> str | None:
        return None if self._subject is None else self._subject.value

    async def _look_again(self) -> None:
        with refusals():
            self._show(await self._preview(self._person))
            if self._joined is not None:
                await self._joined()

    async def _other_hand(self) -> None:
        self._hand = self._side.value
        await self._look_again()

    async def _other_person(self) -> None:
        await self._look_again()

    async def _read_as(self, mapping: ColumnMapping, columns: bool) -> None:
        assert self._table is not None
        self._mapping = mapping
        with refusals():
            body = uploaded(self.file) | read_as(mapping)
            self._table = await self._studio.service.ask(TablePreview, "/takes/preview", body)
            if columns:
                self._columns.clear()
                with self._columns:
                    ColumnsTable(self._read_as).build(self._table)
            await self._look_again()

    def _show(self, seen: ReferencePreview) -> None:
        self._seen = seen
        self._sentence.set_text(seen.sentence)
        if self._take is not None and self._act is not None:
            names = {
                each.id: each.name + (", has a reference" if each.has_reference else "")
                for each in seen.takes
            }
            likeliest = next((each.id for each in seen.takes if each.is_matched), None)
            self._take.set_options(names, value=likeliest)
            self._say_when()
        self._facts.clear()
        with self._facts:
            for sentence in seen.odd:
                ui.label(sentence).classes("take-warning")
            tell_left_out(seen.left_out)
            with (
                ui.expansion("Rotations: what tells each"),
                table(f"Rotations in {self.file[1]}", ("Rotation", "Told by", "From", "To", "Seen")),
            ):
                for each in seen.rotations:
                    text_row(
                        each.rotation, first_of(each.made_of, MOST_MADE_OF), f"{each.low_deg:.0f}°",
                        f"{each.high_deg:.0f}°", f"{100 * each.seen_share:.0f} %",
                    )  # fmt: skip

    @property
    def _chosen(self) -> PossibleTake | None:
        wanted = None if self._take is None else self._take.value
        return next((each for each in self._seen.takes if each.id == wanted), None)

    def _say_when(self) -> None:
        own = self._chosen
        self._of_take.set_text(own.sentence if own else self._seen.problem or NOT_FOUND)
        if self._act is not None:
            self._act.set_enabled(own is not None)

    async def _attach(self) -> None:
        own = self._chosen
        if own is None:
            return
        body = self.body | {"take": own.id, "offset_s": own.offset_s}
        with refusals(warn_long):
            take = await self._studio.service.ask(Take, "/takes/references", body)
            self._place.clear()
            with self._place:
                heading(2, f"{self.file[1]} is now the reference of {take.name}")
                ui.label(own.sentence)
            await self._attached(take, self.file)
