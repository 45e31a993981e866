"""Tables that were dropped: what they are, how their columns are read, and one button that imports them."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, cast

from nicegui import ui
from nicegui.elements.mixins.text_element import TextElement

from glovecal_models.presentation.document import counted, first_of
from glovecal_models.takes.answer import ColumnMapping, MappedColumn, Role, TablePreview, of_takes
from glovecal_service.plain import document_of
from glovecal_service.rest.take.answer import ImportedTakes
from glovecal_service.studio.chosen import Chosen
from glovecal_service.studio.drop import Uploaded
from glovecal_service.studio.heading import heading, main_act
from glovecal_service.studio.service import Refusal, refusals
from glovecal_service.studio.studio import Studio
from glovecal_service.studio.table import row_head, table

ROLE_NAMES: dict[Role, str] = {
    "time": "time", "take": "take", "wearing": "wearing", "pose": "pose", "sensor": "sensor",
    "rotation": "measured angle", "deviation": "deviation of an angle", "context": "context",
    "ignored": "left out",
}  # fmt: skip
UNITS: dict[str, dict[str, str]] = {
    "time": {"s": "s", "ms": "ms", "us": "µs", "ns": "ns", "date": "date"},
    "rotation": {"deg": "degrees", "rad": "radians"},
    "deviation": {"deg": "degrees", "rad": "radians"},
}
LISTED: dict[Role, str] = {"sensor": "Sensors", "rotation": "Measured angles", "ignored": "Left out"}
NAMED = ("sensor", "rotation", "deviation", "context")
USUAL_NAME = "me"
"""Of a wearer nobody has named yet."""
MOST_SHOWN = 24
WITHOUT_ANGLES = (
    "It holds no angles. Drop the file with the angles too (a table, TRC or BVH): both are joined."
)


Imported = Callable[[str, str, Sequence[str], Sequence[Uploaded]], Awaitable[None]]
"""Is awaited with the subject, the layout and the ids of takes, and the files they came from."""


class FilesOfOneShape:
    """Files that are read alike: what they are, their columns, and one button that imports them."""

    def __init__(
        self,
        studio: Studio,
        files: Sequence[tuple[Uploaded, TablePreview]],
        imported: Imported,
        *,
        note: str = "",
        layout: str | None = None,
    ) -> None:
        """``note``: what else is known of the files; ``layout``: of the glove that recorded them, where it is
        known."""
        self._studio = studio
        self._imported = imported
        self._note, self._layout = note, layout
        self._references: Sequence[Mapping[str, Any]] = ()
        self._files = [file for file, _ in files]
        self._seen = [seen for _, seen in files]
        self._is_corrected = False

    @property
    def is_unmeasured(self) -> bool:
        """Whether it holds readings and no angles."""
        return self._seen[0].is_unmeasured

    @property
    def _mapping(self) -> ColumnMapping:
        return self._seen[0].mapping

    async def build(self, about: Chosen) -> None:
        self._place = ui.element("section").classes("finding finding-named")
        self._place.props["aria-label"] = f"Preview of {first_of([seen.file for seen in self._seen], 3)}"
        with self._place:
            self._title = heading(2, "")
            self._sentence = ui.label("").classes("finding-sentence").props('role="status"')
            self._facts = ui.element("div")
            with ui.row().classes("choices"):
                self._subject = ui.input(
                    "Whose takes",
                    value=USUAL_NAME if about.is_simulated else about.person or USUAL_NAME,
                    autocomplete=list(about.people.names),
                )
                self._act = main_act("Import", self._import)
            with ui.expansion("Columns: how they are read").classes("preview-columns") as self._columns:
                pass
            with ui.expansion("Takes").classes("preview-takes") as self._takes:
                pass
        self._show(columns=True)

    def _show(self, *, columns: bool) -> None:
        """``columns``: also the table in which they are corrected, which would lose its focus."""
        first, takes = self._seen[0], [take for seen in self._seen for take in seen.takes]
        problem = next((seen.problem for seen in self._seen if seen.problem), None)
        names = [seen.file for seen in self._seen]
        self._title.set_text(names[0] if len(names) == 1 else f"{len(names)} files: {first_of(names, 3)}")
        self._sentence.set_text(first.sentence if len(names) == 1 or problem else of_takes(takes))
        self._act.set_text(f"Import {counted(len(takes), 'take')}")
        self._act.set_enabled(problem is None and bool(takes))
        self._facts.clear()
        with self._facts:
            if self._note:
                ui.label(self._note)
            if problem:
                ui.label(problem).classes("studio-problem").props('role="alert"')
            if self.is_unmeasured and not self._references:
                ui.label(WITHOUT_ANGLES).classes("take-warning")
            for role, words in LISTED.items():
                named = [item.name or item.header for item in self._mapping.of(role)]
                if any(named):
                    ui.label(f"{words}: {first_of(list(filter(None, named)), MOST_SHOWN)}.")
            [time] = self._mapping.of("time")[:1] or [None]
            if time is not None:
                ui.label(f"Time: {time.header}, in {UNITS['time'].get(time.unit, time.unit)}.")
            if first.is_kept:
                ui.label("Read as the last file with these columns was.")
            for sentence in dict.fromkeys(sentence for seen in self._seen for sentence in seen.odd):
                ui.label(sentence).classes("take-warning")
        self._takes.clear()
        with (
            self._takes,
            table(f"Takes of {names[0]}", ("Take", "Wearing", "Length", "Frames", "Rate", "Measured")),
        ):
            for take in takes:
                with ui.element("tr"):
                    row_head(take.name)
                    rate = "–" if take.rate_hz is None else f"{take.rate_hz:.1f} Hz"
                    for text in (
                        take.wearing or "–", f"{take.duration_s:.1f} s", str(take.frames), rate,
                        first_of(take.rotations, 6) or "nothing",
                    ):  # fmt: skip
                        TextElement(tag="td", text=text)
        if columns:
            self._columns.clear()
            with self._columns:
                ColumnsTable(self._read_as).build(first)

    async def join(self, references: Sequence[Mapping[str, Any]]) -> None:
        """With the angles of other files, as requests name them."""
        self._references = references
        await self._look_again(columns=False)

    async def _read_as(self, mapping: ColumnMapping, columns: bool) -> None:
        self._is_corrected = True
        await self._look_again(mapping, columns=columns)

    async def _look_again(self, mapping: ColumnMapping | None = None, *, columns: bool) -> None:
        with refusals():
            self._seen = [
                await self._studio.service.ask(
                    TablePreview, "/takes/preview", self._body(file, mapping or seen.mapping, seen)
                )
                for file, seen in zip(self._files, self._seen, strict=True)
            ]
            self._show(columns=columns)

    def _body(self, file: Uploaded, mapping: ColumnMapping, seen: TablePreview) -> dict[str, Any]:
        is_own = seen.is_take_table and not self._is_corrected
        return uploaded(file) | {"references": self._references} | ({} if is_own else read_as(mapping))

    async def _import(self) -> None:
        self._act.disable()
        takes, warnings, layout = [], [], ""
        try:
            for file, seen in zip(self._files, self._seen, strict=True):
                body = self._body(file, seen.mapping, seen) | {
                    "subject": self._subject.value, "create_subject": True, "equal_times": seen.equal_times,
                    "layout": self._layout,
                }  # fmt: skip
                found = await self._studio.service.ask(ImportedTakes, "/takes/import", body)
                takes += found.takes
                warnings += found.warnings
                layout = found.layout
        except Refusal as refusal:
            ui.notify(str(refusal), type="warning", timeout=10_000)
            self._act.enable()  # what is here already is not imported twice
            return
        self._place.clear()
        with self._place:
            heading(2, f"{counted(len(takes), 'take')} imported")
            for sentence in dict.fromkeys(warnings):
                ui.label(sentence).classes("take-warning")
        await self._imported(takes[0].subject, layout, [take.id for take in takes], self._files)


class ColumnsTable:
    """How each column of a table is read, with its reason; what is corrected in its row is told."""

    def __init__(self, changed: Callable[[ColumnMapping, bool], Awaitable[None]]) -> None:
        """``changed``: is awaited with the corrected mapping, and whether this table has to be built anew,
        which takes the focus from its fields."""
        self._changed_to = changed

    def build(self, seen: TablePreview) -> None:
        self._mapping = seen.mapping
        heads = ("Column", "First cells", "Read as", "Name", "Unit", "Because")
        with table(f"Columns of {seen.file} and how they are read", heads):
            for at, item in enumerate(self._mapping.columns):
                with ui.element("tr"):
                    row_head(item.header or f"column {at + 1}")
                    cells = ", ".join(row[at] for row in seen.rows[:3] if at < len(row))
                    TextElement(tag="td", text=cells)
                    with ui.element("td"):
                        field = ui.select(ROLE_NAMES, value=item.role, on_change=partial(self._role, at))
                        _called(field, f"What {item.header} is")
                    with ui.element("td"):
                        if item.role in NAMED:
                            field = ui.input(value=item.name, on_change=partial(self._name, at))
                            _called(field.props("debounce=600"), f"Name of {item.header}")
                    with ui.element("td"):
                        if item.role in UNITS:
                            units = UNITS[item.role]
                            field = ui.select(units, value=item.unit, on_change=partial(self._unit, at))
                            _called(field, f"Unit of {item.header}")
                    TextElement(tag="td", text=item.why)

    async def _role(self, at: int, event: Any) -> None:
        role = cast(Role, event.value)
        old = self._mapping.columns[at]
        unit = old.unit if old.unit in UNITS.get(role, {}) else next(iter(UNITS.get(role, {"": ""})))
        name = old.name if role in NAMED else ""
        new = replace(old, role=role, unit=unit, name=name, why="corrected")
        await self._changed(at, new, columns=True)

    async def _name(self, at: int, event: Any) -> None:
        await self._changed(at, replace(self._mapping.columns[at], name=event.value.strip()), columns=False)

    async def _unit(self, at: int, event: Any) -> None:
        await self._changed(at, replace(self._mapping.columns[at], unit=event.value), columns=False)

    async def _changed(self, at: int, column: MappedColumn, *, columns: bool) -> None:
        every = list(self._mapping.columns)
        every[at] = column
        self._mapping = replace(self._mapping, columns=tuple(every))
        await self._changed_to(self._mapping, columns)


def _called(field: ui.element, name: str) -> None:
    """For screen readers; a file's own words are never parsed as properties."""
    field.props("dense").props["aria-label"] = name


def uploaded(file: Uploaded) -> dict[str, Any]:
    return {"upload": file[0], "filename": file[1]}


def read_as(mapping: ColumnMapping) -> dict[str, Any]:
    return {"mapping": document_of(mapping)}
