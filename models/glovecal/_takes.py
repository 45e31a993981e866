"""Takes from and to tables."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from os import PathLike
from pathlib import Path
from typing import Literal

from glovecal._layouts import LayoutLike, layout_for
from glovecal._shown import Shown
from glovecal._table import Column, Table
from glovecal_models.errors import BadInput
from glovecal_models.takes.answer import ColumnMapping, EqualTimes, TablePreview
from glovecal_models.takes.take import Take

COLUMNS = (
    Column("take"), Column("wearing"), Column("frames"), Column("duration_s", 1), Column("sensors"),
    Column("rotations"), Column("context"), Column("simulated"),
)  # fmt: skip


class Takes(Shown, list[Take]):
    """A list of takes that shows what they hold."""

    def __init__(self, takes: Iterable[Take] = (), sentences: Sequence[str] = ()) -> None:
        super().__init__(takes)
        self.sentences: tuple[str, ...] = tuple(sentences)
        """What was done to the takes on reading them, and what looks wrong."""

    def table(self) -> Table:
        """One row for each take."""
        rows = [
            (
                item.name, item.wearing, len(item.time_s), item.duration_s, len(item.sensors),
                len(item.rotations), ", ".join(item.context), item.simulated,
            )
            for item in self
        ]  # fmt: skip
        count = f"{len(self)} {'take' if len(self) == 1 else 'takes'}"
        return Table.of(COLUMNS, rows, before=[count], after=self.sentences)

    def worn(self, *wearings: str) -> Takes:
        """Those of the wearings of these names."""
        return Takes(item for item in self if item.wearing in wearings)


def read_takes(
    *paths: str | PathLike[str],
    layout: LayoutLike = None,
    reference: str | PathLike[str] | None = None,
    name: str | None = None,
    wearing: str | None = None,
    equal_times: EqualTimes = "refuse",
    columns: Literal["guess"] | ColumnMapping | None = None,
) -> Takes:
    """All takes of CSV or Parquet files, in the order of their first rows.

    Columns are ``time_s``, ``take``, ``wearing``, ``pose``, ``s.<SENSOR>`` (raw readings), ``r.<ROTATION>``
    (degrees) and ``c.<CONTEXT>``. ``reference``: a table of reference angles with a clock of its own; beside
    ``X.frames.csv`` it is found by itself as ``X.reference.csv``. ``layout`` refuses takes that lack a sensor
    of it. ``name`` and ``wearing`` say what the file does not; ``equal_times="spread"`` spreads frames that
    were stamped in batches. ``columns`` reads tables of other programs: "guess" as ``look`` shows, or its
    ``mapping``, corrected. Raises BadInput with file, line, column and value; nothing is half read.
    """
    from glovecal_models.calibration.samples import require_layout
    from glovecal_models.takes.angles_on_a_circle import unwrapped
    from glovecal_models.takes.column_guess import guess_mapping
    from glovecal_models.takes.table import read_takes as read
    from glovecal_models.takes.take_check import alike_once, take_warnings

    if reference is not None and len(paths) != 1:
        raise BadInput(f"one reference table belongs to one file of frames, not to {len(paths)}")
    beside = None if reference is None else Path(reference)
    found: list[Take] = []
    for path in map(Path, paths):
        mapping = guess_mapping(path) if columns == "guess" else columns
        found += read(path, beside, name=name, wearing=wearing, equal_times=equal_times, mapping=mapping)
    if layout is not None:
        wanted = layout_for(layout, found)
        for take in found:
            require_layout(take, wanted)
    circle = unwrapped(found)
    return Takes(circle.takes, [*alike_once(circle.sentences), *take_warnings(circle.takes)])


def look(path: str | PathLike[str]) -> TablePreview:
    """What a CSV or Parquet table of any program would become: how its columns are read and why, its takes,
    what is odd. Raises BadInput for what is no table of numbers."""
    from glovecal_models.takes.table_preview import preview_table

    return preview_table(Path(path))


def write_takes(takes: Take | Iterable[Take], path: str | PathLike[str]) -> list[Path]:
    """Write takes to a .csv or .parquet file; gives the files written.

    There are two where the reference has a clock of its own. Reading them gives back exactly what was
    written. Raises BadInput for takes that cannot share a file.
    """
    from glovecal_models.takes.write_table import write_takes as write

    return write(_listed(takes), Path(path))


def takes_in(takes: Take | Iterable[Take]) -> Sequence[Take]:
    """One take or several as they are worked with: a list, without reference angles that jump away and come
    back. Raises BadInput for anything else, and for none."""
    from glovecal_models.takes.reference_jumps import without_jumps

    return [without_jumps(take) for take in _listed(takes)]


def _listed(takes: Take | Iterable[Take]) -> Sequence[Take]:
    if isinstance(takes, Take):
        return [takes]
    if isinstance(takes, str | PathLike):
        raise BadInput(f"{str(takes)!r} is a path, where takes are wanted: give read_takes({str(takes)!r})")
    found = list(takes)
    if not found:
        raise BadInput("no takes were given")
    wrong = next((item for item in found if not isinstance(item, Take)), None)
    if wrong is not None:
        raise BadInput(f"takes hold a {type(wrong).__name__}, which is no Take")
    return found
