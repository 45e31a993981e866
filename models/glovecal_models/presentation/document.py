"""An answer, and how a person reads it.

The result of a question is a frozen dataclass: its fields and their docstrings are the schema of REST, jobs
and ``--json``. Its ``presentation()`` is drawn by the terminal, by ``html`` (pages, studio, notebooks) and by
``text`` (``print``). A chart is a function on matplotlib's axes: vector pictures in a page that needs no
script and no network, in a notebook, in a paper; ECharts is left for what moves or is zoomed into.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Sequence
from dataclasses import KW_ONLY, dataclass
from importlib import import_module
from typing import TYPE_CHECKING, Any, TypeVar, dataclass_transform

from glovecal_models.installation import not_installed
from glovecal_models.presentation.field_descriptions import describe_fields

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Result = TypeVar("Result")
Cell = str | int | float | bool | None
DASH = "-"
"""Of a number that is missing."""
MOST_PRINTED, MOST_COLUMNS = 60, 12
"""What is printed; a frame holds everything."""
ENDS = 5
GAP = "..."


@dataclass_transform(frozen_default=True)
def answer(cls: type[Result]) -> type[Result]:
    """A frozen dataclass whose attributes' docstrings describe its fields in a schema."""
    # What follows from other fields has a default and is worked out in __post_init__, also when read back.
    cls.__pydantic_config__ = {"json_schema_extra": describe_fields}  # pyright: ignore[reportAttributeAccessIssue]
    return dataclass(frozen=True, repr=not issubclass(cls, Answer))(cls)


@dataclass(frozen=True)
class Column:
    """``name`` is its key in a data frame, its unit at the end, such as ``rmse_deg``."""

    name: str
    heading: str | None = None
    """None: ``name``."""
    digits: int = 2
    """Decimals of its numbers."""
    folds: bool = False
    """Whether it is what wraps on a narrow terminal."""


@dataclass(frozen=True)
class Table:
    columns: Sequence[Column]
    rows: Sequence[Sequence[Cell]]
    legend: str = ""
    """What its numbers are: units, scale, data."""
    empty: str = ""
    """The sentence for no rows."""
    printed: int | None = None
    """Rows that are printed, the first; None: all."""

    @property
    def headings(self) -> list[str]:
        return [item.name if item.heading is None else item.heading for item in self.columns]

    @property
    def texts(self) -> list[list[str]]:
        """Its cells as they are printed."""
        return [
            [cell_text(value, column.digits) for value, column in zip(row, self.columns, strict=True)]
            for row in self.rows
        ]

    @property
    def are_words(self) -> list[bool]:
        """For each column whether its cells are words and not numbers."""
        return [any(isinstance(row[at], str) for row in self.rows) for at in range(len(self.columns))]

    def frame(self) -> Any:
        """A pandas DataFrame, numbers unrounded. Raises ImportError without pandas."""
        try:
            pandas = import_module("pandas")
        except ImportError as error:
            raise ImportError(not_installed("to_frame()", "pandas")) from error
        return pandas.DataFrame(list(self.rows), columns=[item.name for item in self.columns])


@dataclass(frozen=True)
class Chart:
    """One picture; ``draw`` fills one pair of axes, or with ``panels`` a figure."""

    draw: Callable[[Axes], object] | None
    width: float
    height: float
    """Inches."""
    sentence: str
    """What it shows in this data."""
    panels: Callable[[Figure], object] | None = None


@dataclass(frozen=True)
class Lines:
    """Sentences, one below the other."""

    sentences: Sequence[str]


@dataclass(frozen=True)
class Note:
    """What has to be heeded before anything else; warnings that differ in numbers only are counted."""

    heading: str
    sentences: Sequence[str]


@dataclass(frozen=True)
class Explanation:
    """How something is meant or measured; not printed at a terminal."""

    text: str


@dataclass(frozen=True)
class Pictures:
    """Charts beside each other where there is room; ``are_small``: in their own size."""

    charts: Sequence[Chart]
    are_small: bool = False


@dataclass(frozen=True)
class Folded:
    """Opened by a click, and not printed at a terminal."""

    heading: str
    parts: Sequence[Part]


@dataclass(frozen=True)
class Block:
    """One thing of a section with what belongs to it; of it only tables are printed at a terminal."""

    heading: str
    parts: Sequence[Part]


Part = str | Table | Chart | Lines | Note | Explanation | Pictures | Folded | Block
"""A text is a paragraph."""


@dataclass(frozen=True)
class Section:
    heading: str
    parts: Sequence[Part]
    is_detail: bool = False
    """Not printed at a terminal."""


@dataclass(frozen=True)
class Fact:
    """One line at the head; without a label it belongs to the one before."""

    label: str
    text: str
    is_command: bool = False


@dataclass(frozen=True)
class Presentation:
    """Sections without parts are left out."""

    title: str
    summary: Sequence[Fact] = ()
    """The verdict first, and at the end what to do next."""
    notes: Sequence[Note] = ()
    sections: Sequence[Section] = ()

    @property
    def shown(self) -> list[Section]:
        return [item for item in self.sections if item.parts]

    def parts(self) -> Iterable[Part]:
        for section in self.shown:
            yield from section.parts

    @property
    def table(self) -> Table:
        """The first of its tables: the one that a data frame holds."""
        return next((item for item in self.parts() if isinstance(item, Table)), Table((), ()))

    @property
    def chart(self) -> Chart:
        """The first of its charts. Raises ValueError when it has none."""
        found = next((item for item in self.parts() if isinstance(item, Chart) and item.draw), None)
        if found is None:
            raise ValueError(f"{self.title}: there is nothing to draw")
        return found


class Answer(ABC):
    """A result that can be read: printed, shown in a notebook, drawn, made a data frame."""

    @abstractmethod
    def presentation(self) -> Presentation: ...

    def to_frame(self) -> Any:
        """Its table as a pandas DataFrame, numbers unrounded. Raises ImportError without pandas."""
        return self.presentation().table.frame()

    def plot(self, *, ax: Axes | None = None) -> Axes:
        """Its chart, on ``ax`` or axes of its own, which it gives back. Raises ImportError without
        matplotlib."""
        from glovecal_models.presentation.drawing import plotted

        return plotted(self.presentation().chart, ax)

    def __str__(self) -> str:
        return as_text(self.presentation())

    __repr__ = __str__

    def _repr_html_(self) -> str:
        from glovecal_models.presentation.html import notebook_html

        return notebook_html(self.presentation())


@answer
class TakeNamed:
    """A take as an answer names it."""

    id: str
    name: str


def as_text(shown: Presentation) -> str:
    """Title, summary, and every section's tables and sentences; no charts."""
    blocks = [f"{shown.title}:", *_summary(shown.summary), *(_note(item) for item in shown.notes)]
    for section in shown.shown:
        parts = [] if section.is_detail else [_part(part) for part in section.parts]
        if any(parts):
            blocks.append("\n".join([f"{section.heading}:", *filter(None, parts)]))
    return "\n\n".join(filter(None, blocks))


def _summary(facts: Sequence[Fact]) -> list[str]:
    return ["\n".join(f"{item.label}: {item.text}" if item.label else item.text for item in facts)]


def _note(note: Note) -> str:
    return "\n".join([f"{note.heading}:"] * bool(note.heading) + [f"  {item}" for item in note.sentences])


def _part(part: Part) -> str:
    if isinstance(part, Table):
        return aligned(part) if part.rows else part.empty
    if isinstance(part, Lines):
        return "\n".join(f"  {item}" for item in part.sentences)
    if isinstance(part, Note):
        return _note(part)
    if isinstance(part, Block):
        return "\n".join(_part(inner) for inner in part.parts if isinstance(inner, Table))
    return part if isinstance(part, str) else ""


def aligned(table: Table) -> str:
    """Numbers to the right, words to the left; the middle of a large table is left out."""
    headings, words, rows = table.headings, table.are_words, table.texts[: table.printed]
    more = [f"and {len(table.rows) - len(rows)} more"] * (len(rows) < len(table.rows))
    if len(rows) > MOST_PRINTED:
        rows = [*rows[:ENDS], [GAP] * len(headings), *rows[-ENDS:]]
    if len(headings) > MOST_COLUMNS:
        headings, words = [*headings[:MOST_COLUMNS], GAP], [*words[:MOST_COLUMNS], True]
        rows = [[*row[:MOST_COLUMNS], GAP] for row in rows]
    widths = [max(map(len, column)) for column in zip(headings, *rows, strict=True)]

    def line(cells: Sequence[str]) -> str:
        each = zip(cells, widths, words, strict=True)
        return "  ".join(c.ljust(w) if is_word else c.rjust(w) for c, w, is_word in each).rstrip()

    return "\n".join([*map(line, (headings, *rows)), *more])


def cell_text(value: Cell, digits: int = 2) -> str:
    """A cell as it is printed: two decimals, a dash for a missing number, yes and no."""
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return DASH
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:.{digits}f}" if isinstance(value, float) else str(value)


def counted(count: int, noun: str) -> str:
    """ "1 take", "2 takes"."""
    return f"{count} {noun}{'' if count == 1 else 's'}"


def first_of(names: Sequence[str], most: int = 12) -> str:
    """The first dozen."""
    return ", ".join(names[:most]) + (" ..." if len(names) > most else "")


def with_same_reason(reasons: Iterable[tuple[str, str]]) -> list[str]:
    """From names and why: "name, name: why", those with the same reason together."""
    names: dict[str, list[str]] = {}
    for name, why in reasons:
        names.setdefault(why, []).append(name)
    return [f"{', '.join(dict.fromkeys(each))}: {why}" for why, each in names.items()]


@answer
class AboutTakes(Answer):
    """An answer about takes, or about a model on takes."""

    _: KW_ONLY
    subject: str = ""
    model: str | None = None
    """Null: takes were looked at without a model."""
    method: str | None = None
    """Of the model."""
    title: str = ""
    """The model as people call it: subject, version and date."""
    takes: Sequence[TakeNamed] = ()
    simulated: bool = False
    """Whether any of the takes is of a simulated glove."""

    @property
    def about(self) -> str:
        """ "4 takes of anna, version 2 of 22 November 2026 (lmc_gpr, 0123456789ab; simulated glove)"."""
        facts = [f"{self.method}, {self.model[:12]}"] if self.model else []
        facts += ["simulated glove"] * self.simulated
        of = self.title or self.subject
        brackets = f" ({'; '.join(facts)})" if facts else ""
        return f"{counted(len(self.takes), 'take')}{f' of {of}' if of else ''}{brackets}"
