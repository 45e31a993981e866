"""Answers about takes: their clocks; what a table would become if it were imported."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Sequence
from typing import Literal

from glovecal_models.presentation.document import (
    DASH,
    Answer,
    Column,
    Fact,
    Lines,
    Presentation,
    Section,
    Table,
    answer,
    counted,
)
from glovecal_models.takes.take import Stretch

ClockVerdict = Literal["offset", "agrees", "not identifiable", "range too small"]


@answer
class TakeClock:
    """The clocks of one take."""

    id: str
    take: str
    verdict: ClockVerdict
    offset_s: float | None
    """Reference time = frame time + offset; 0 unless found."""
    low_s: float | None
    """From here to `high_s` at most twice the least variance is unexplained."""
    high_s: float | None
    unexplained_before: float | None
    """Share of the variance that no linear map explains."""
    unexplained_after: float | None
    unexplained_reversed: float | None
    """The same by chance: sensors played backwards."""
    sentence: str
    repaired: bool

    @property
    def is_found(self) -> bool:
        return self.verdict in ("offset", "agrees")


# A take over time.


@answer
class Curves:
    """Several curves over one axis."""

    names: Sequence[str]
    at: Sequence[float]
    """Seconds since the first frame, or Hz."""
    values: Sequence[Sequence[float | None]]
    """Of each curve; null where nothing was measured."""


@answer
class JumpInTake:
    """Where a rotation's reference jumps while the sensors do not."""

    rotation: str
    start_s: float
    end_s: float
    size_deg: float
    comes_back: bool
    """Its angles are left out of training and of errors."""


@answer
class TakeSeries:
    """A take as it is drawn; seconds count from its first frame."""

    take: str
    duration_s: float
    rate_hz: float | None
    """By the median interval between frames."""
    pre_roll_s: float
    """Recorded before it was asked for."""
    readings: Curves
    """Of each sensor, in counts."""
    reference: Curves
    """Of each rotation, in degrees."""
    gaps: Sequence[tuple[float, float]]
    """Where frames are missing: from and to."""
    jumps: Sequence[JumpInTake]
    spectra: Curves
    """Amplitude of each sensor's movement over frequency, in counts; empty for a short take."""
    left_out: Sequence[Stretch] = ()
    """By a person, from training, comparison and diagnosis: from and to."""


# How a table that some other program wrote is read, and what it would become.

Role = Literal["time", "take", "wearing", "pose", "sensor", "rotation", "deviation", "context", "ignored"]
EqualTimes = Literal["refuse", "spread"]
Unit = Literal["", "s", "ms", "us", "ns", "date", "deg", "rad"]
PER_UNIT: dict[Unit, float] = {
    "": 1.0, "s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "date": 1.0, "deg": 1.0, "rad": 180.0 / math.pi,
}  # fmt: skip
"""Seconds, or degrees."""
PLAIN = {"time": "time_s", "take": "take", "wearing": "wearing", "pose": "pose"}
PREFIX = {"sensor": "s", "rotation": "r", "deviation": "sd", "context": "c"}


@answer
class MappedColumn:
    """How one column is read."""

    header: str
    """As it stands in the file."""
    role: Role
    name: str = ""
    """Of the sensor, rotation or context."""
    unit: Unit = ""
    """Of a time: `s`, `ms`, `us`, `ns`, or `date`; of an angle: `deg` or `rad`."""
    why: str = ""
    """What speaks for it."""
    example: str = ""
    """Its first cell."""

    @property
    def in_a_take_table(self) -> str:
        """Its header there; "" when it is left out."""
        if self.role == "ignored":
            return ""
        return PLAIN.get(self.role) or f"{PREFIX[self.role]}.{self.name}"

    @property
    def scale(self) -> float:
        return PER_UNIT[self.unit]


@answer
class ColumnMapping:
    """How a table is read."""

    columns: tuple[MappedColumn, ...]
    separator: str = ","
    """Between columns. A blank stands for any number of them; a Parquet file has none of it."""
    decimal_comma: bool = False
    header_line: int = 1
    """Line of the columns' names; 0: there are none."""
    divides_at_pauses: bool = False
    """Whether another take begins where the time starts again, or after two seconds without a frame."""

    @property
    def shape(self) -> str:
        """The same for files that can be read the same way."""
        named = "\n".join([self.separator, str(self.decimal_comma), *(item.header for item in self.columns)])
        return hashlib.sha256(named.encode("utf-8", "replace")).hexdigest()

    def of(self, role: Role) -> list[MappedColumn]:
        return [item for item in self.columns if item.role == role]


@answer
class TakeInTable:
    """A take that the table holds."""

    name: str
    wearing: str
    frames: int
    duration_s: float
    rate_hz: float | None
    """By the mean interval between frames."""
    sensors: int
    rotations: Sequence[str]
    """Measured in it."""


@answer
class TablePreview(Answer):
    """What a table would become."""

    file: str
    is_take_table: bool
    """Whether its columns have a take table's own names."""
    is_kept: bool
    """Whether `mapping` was kept from an import of the same shape."""
    mapping: ColumnMapping
    equal_times: EqualTimes
    """`spread`: frames are stamped in batches, and each is spread up to the next time."""
    takes: Sequence[TakeInTable]
    """As it is read now; none where it cannot be."""
    rows: Sequence[Sequence[str]]
    """The first of the file, under its columns."""
    odd: Sequence[str]
    """What looks wrong in it."""
    problem: str | None
    """Why nothing can be imported as it is read now."""
    sentence: str = ""
    """What is made of it."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "sentence", _made(self))

    @property
    def is_reference(self) -> bool:
        """Whether it holds angles and no readings."""
        return bool(self.mapping.of("rotation")) and not self.mapping.of("sensor")

    @property
    def is_unmeasured(self) -> bool:
        """Whether it holds readings and no angles."""
        return bool(self.mapping.of("sensor")) and not self.mapping.of("rotation")

    def presentation(self) -> Presentation:
        columns = Table(
            [*map(Column, ("column", "is", "name", "unit")), Column("because", folds=True), Column("first")],
            [
                [item.header, item.role, item.name or DASH, item.unit or DASH, item.why, item.example]
                for item in self.mapping.columns
            ],
        )
        takes = Table(
            [Column("take"), Column("wearing"), Column("frames"), Column("seconds", digits=1),
             Column("rate_hz", "Hz", 1), Column("measured", folds=True)],
            [
                [item.name, item.wearing or DASH, item.frames, item.duration_s, item.rate_hz,
                 ", ".join(item.rotations) or "nothing"]
                for item in self.takes
            ],
        )  # fmt: skip
        return Presentation(
            self.file,
            [Fact("", self.sentence)],
            sections=[
                Section("Columns", [columns]),
                Section("Takes", [takes] if self.takes else []),
                Section("What is odd", [Lines(self.odd)] if self.odd else []),
            ],
        )


def _made(found: TablePreview) -> str:
    if found.is_reference:
        measured = counted(len(found.mapping.of("rotation")), "rotation")
        return f"{measured} measured, and no readings: this is the reference of a take recorded elsewhere."
    if found.problem:
        return f"Nothing can be imported as it is read now: {found.problem}."
    return of_takes(found.takes)


def of_takes(takes: Sequence[TakeInTable]) -> str:
    """What takes of the same columns come to."""
    wearings = {take.wearing for take in takes if take.wearing}
    rotations = {name for take in takes for name in take.rotations}
    in_wearings = f"in {counted(len(wearings), 'wearing')}" if wearings else "of which no wearing is known,"
    measured = (
        f"{counted(len(rotations), 'rotation')} measured: a model can learn from it."
        if rotations
        else "nothing measured: a model can be applied to it, and none can learn from it."
    )
    seconds = sum(take.duration_s for take in takes)
    sensors = counted(takes[0].sensors, "sensor")
    return f"{counted(len(takes), 'take')} {in_wearings} of {sensors}, {seconds:.0f} s in all; {measured}"
