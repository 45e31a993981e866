"""Take tables: takes from and to CSV and Parquet files.

A table has the column ``time_s`` (seconds of any origin, increasing within a take), optional ``take``,
``wearing`` and ``pose`` (text), ``s.<SENSOR>`` raw readings, ``r.<ROTATION>`` reference angles in degrees
(empty where not measured), ``sd.<ROTATION>`` their standard deviations in degrees where their source states
them, and ``c.<NAME>`` context numbers. The reference may stand in a table of its own
with a time column of its own; of two files ``X.frames.csv`` and ``X.reference.csv`` the second is found
by itself. ``c.simulated`` other than 0 marks a simulated take.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from glovecal_models.errors import BadTakeTable
from glovecal_models.takes.answer import ColumnMapping, EqualTimes
from glovecal_models.takes.column_mapping import mapped_table
from glovecal_models.takes.raw_table import (
    LONGEST_TAKE_S,
    YEAR_S,
    ColumnKind,
    RawTable,
    spread_equal_times,
    too_few_digits,
    unit_hint,
)
from glovecal_models.takes.read_table import MAGIC, read_csv_table, read_parquet_table
from glovecal_models.takes.take import Take, deviation_problem, poses_at_frames
from glovecal_models.takes.write_table import SIMULATED_CONTEXT

_SUFFIXES = (".csv", ".parquet")


WEARING_IN_NAME = re.compile(
    r"(?:^|[^a-z])((?:wearing|donning|placement|session|day|w)[-_ ]?\d+)(?![0-9a-z])", re.I
)


@dataclass(frozen=True)
class ReferenceRows:
    """Reference angles of one take, on a clock of their own."""

    time_s: np.ndarray
    """Shape (N,), seconds, increasing."""
    rotations: tuple[str, ...]
    reference: np.ndarray
    """Shape (N, len(rotations)), degrees; NaN where not measured."""
    poses: tuple[str, ...] | None
    reference_sd: np.ndarray | None = None
    """Stated standard deviations as ``Take`` holds them."""


def read_takes(
    frames: Path,
    reference: Path | None = None,
    *,
    name: str | None = None,
    wearing: str | None = None,
    equal_times: EqualTimes = "refuse",
    mapping: ColumnMapping | None = None,
) -> list[Take]:
    """All takes of a file, in the order of their first rows. Raises BadTakeTable; nothing is half read.

    Rows with the same text in column ``take`` are one take; without the column all rows are. ``name``
    replaces the name of a single take and goes before those of several; without it a take is named by the
    column, else after the file. ``wearing`` says what the file does not; without either it is "".
    Rotations and context that were never measured in a take are left out of it. Frames that were stamped
    in batches have equal times; ``equal_times="spread"`` spreads each batch up to the next time. ``mapping``:
    how ``frames`` is read, if it is no take table; its name may say the wearing then (``anna-w2-t3.csv``).
    """
    if mapping is not None and wearing is None and not mapping.of("wearing"):
        wearing = wearing_of(frames.stem)
    table = _read_table(frames, equal_times, mapping)
    if not table.names("sensor"):
        raise table.error("no readings: there is no column s.<SENSOR>")
    if reference is None:
        reference = reference_beside(frames)
    measured = None if reference is None else _read_reference_table(reference)
    if measured is not None and table.names("rotation"):
        raise table.error(f"reference angles stand both here (r. columns) and in {measured.file}; keep one")
    groups = _rows_by_take(table)
    references = {} if measured is None else _match_references(table, groups, measured)
    title = _title(frames)
    takes = []
    for key, rows in groups.items():
        label = _take_name(key, name, title, alone=len(groups) == 1)
        takes.append(_build_take(table, rows, label, _wearing(table, rows, wearing), references.get(key)))
    return takes


def read_reference(path: Path, mapping: ColumnMapping | None = None) -> dict[str | None, ReferenceRows]:
    """A reference table alone, by take name (None where it has no ``take`` column). ``mapping``: how it is
    read, if its columns have names of their own. Raises BadTakeTable."""
    table = _read_reference_table(path, mapping)
    return {key: _reference_rows(table, rows) for key, rows in _rows_by_take(table).items()}


def wearing_of(name: str) -> str | None:
    """The wearing that a file's name says, such as ``w2`` of ``anna-w2-t3``; None when it says none."""
    found = WEARING_IN_NAME.search(name)
    return found[1] if found else None


def reference_beside(frames: Path) -> Path | None:
    """For ``X.frames.csv`` the existing file ``X.reference.csv`` (or .parquet) in the same folder."""
    for suffix in _SUFFIXES:
        if frames.name.lower().endswith(f".frames{suffix}"):
            stem = frames.name[: -len(f".frames{suffix}")]
            found = (frames.with_name(f"{stem}.reference{other}") for other in (suffix, *_SUFFIXES))
            return next((path for path in found if path.is_file()), None)
    return None


def _read_table(
    path: Path, equal_times: EqualTimes = "refuse", mapping: ColumnMapping | None = None
) -> RawTable:
    if not path.is_file():
        raise BadTakeTable("there is no such file", file=str(path))
    table = _own_table(path) if mapping is None else mapped_table(path, mapping)
    if equal_times == "spread":
        table = _with_spread_times(table)
    _require_increasing_time(table)
    _require_duration(table)
    return table


def _own_table(path: Path) -> RawTable:
    with path.open("rb") as stream:
        is_parquet = stream.read(len(MAGIC)) == MAGIC
    if path.suffix.lower() == ".parquet" and not is_parquet:
        raise BadTakeTable("not a Parquet file (it does not begin with PAR1)", file=path.name)
    return read_parquet_table(path) if is_parquet else read_csv_table(path)


def _with_spread_times(table: RawTable) -> RawTable:
    time = table.time_s.copy()
    for rows in _rows_by_take(table).values():
        if not too_few_digits(time[rows]):  # else refused below
            time[rows] = spread_equal_times(time[rows])
    return replace(table, numbers=table.numbers | {"time_s": time})


def _read_reference_table(path: Path, mapping: ColumnMapping | None = None) -> RawTable:
    table = _read_table(path, mapping=mapping)
    refused: tuple[ColumnKind, ...] = ("sensor", "context", "wearing")
    for column in table.columns:
        if column.kind in refused:
            raise table.error(
                "a reference table holds time_s, take, pose, r. and sd. columns only; readings, context and "
                "wearing belong to the frames",
                column=column.header,
            )
    if not table.names("rotation"):
        raise table.error("no reference angles: there is no column r.<ROTATION>")
    return table


def _rows_by_take(table: RawTable) -> dict[str | None, np.ndarray]:
    """Row numbers of each take; the only key is None where the table has no ``take`` column."""
    if "take" not in table.texts:
        return {None: np.arange(len(table))}
    rows: dict[str | None, list[int]] = {}
    for row, take in enumerate(table.texts["take"]):
        rows.setdefault(take, []).append(row)
    return {take: np.array(at) for take, at in rows.items()}


def _require_increasing_time(table: RawTable) -> None:
    for take, rows in _rows_by_take(table).items():
        time = table.time_s[rows]
        back = np.flatnonzero(np.diff(time) <= 0)
        if len(back):
            before, row = int(rows[back[0]]), int(rows[back[0] + 1])
            if too_few_digits(time):
                raise table.error(
                    f"{len(time)} frames have {len(np.unique(time))} different times: they are written with "
                    "too few digits to tell when a frame was taken. Export them again with milliseconds",
                    row=row,
                    column="time_s",
                )
            raise table.error(
                f"{table.time_s[row]} does not come after {table.time_s[before]}; time must increase "
                f"within a take{_time_hint(table.time_s[row] == table.time_s[before], take)}",
                row=row,
                column="time_s",
            )


def _require_duration(table: RawTable) -> None:
    for rows in _rows_by_take(table).values():
        time = table.time_s[rows]
        lasts = float(time[-1] - time[0])
        if lasts > LONGEST_TAKE_S:
            steps = np.diff(time)
            largest = int(steps.argmax())
            row = int(rows[largest + 1 if steps[largest] > lasts / 2 else -1])
            raise table.error(
                f"{table.time_s[row]} is {lasts / YEAR_S:.3g} years after the first frame of its take, which "
                f"is recorded in one wearing; write the time in seconds{unit_hint(float(np.median(steps)))}",
                row=row,
                column="time_s",
                value=str(table.time_s[row]),
            )


def _time_hint(equal: bool, take: str | None) -> str:
    if equal:
        return (
            " (frames stamped in batches? --spread-equal-times, over REST equal_times=spread, spreads them)"
        )
    return " (several takes in one file need a column take)" if take is None else ""


def _match_references(
    table: RawTable, groups: dict[str | None, np.ndarray], measured: RawTable
) -> dict[str | None, ReferenceRows]:
    references = {key: _reference_rows(measured, rows) for key, rows in _rows_by_take(measured).items()}
    if len(groups) == 1 and len(references) == 1 and (None in groups or None in references):
        return dict(zip(groups, references.values(), strict=True))
    if None in groups or None in references:
        lacking, other = (table, measured) if None in groups else (measured, table)
        raise lacking.error(
            f"there is no column take, but {other.file} holds {max(len(groups), len(references))} takes; "
            "name each row's take in both tables"
        )
    for key in references:
        if key not in groups:
            raise measured.error(
                f"take {key!r} has a reference, but no frames in {table.file}",
                row=measured.texts["take"].index(str(key)),
                column="take",
            )
    return references


def _reference_rows(table: RawTable, rows: np.ndarray) -> ReferenceRows:
    rotations, reference = _only_measured(table.names("rotation"), table.matrix("rotation", rows))
    deviations = _deviations(table, rows, rotations, reference)
    return ReferenceRows(table.time_s[rows], rotations, reference, _poses(table, rows), deviations)


def _deviations(
    table: RawTable, rows: np.ndarray, rotations: tuple[str, ...], reference: np.ndarray
) -> np.ndarray | None:
    stated = [name for name in table.names("deviation") if name in rotations]
    if not stated:
        return None
    found = np.full_like(reference, np.nan)
    for name in stated:
        column = rotations.index(name)
        values = table.numbers[f"sd.{name}"][rows]
        found[:, column] = np.where(np.isfinite(reference[:, column]), values, np.nan)
        problem = deviation_problem([name], reference[:, [column]], found[:, [column]])
        if problem is not None:
            raise table.error(problem[1], row=int(rows[problem[0]]), column=f"sd.{name}")
    return found if np.isfinite(found).any() else None


def _only_measured(names: tuple[str, ...], values: np.ndarray) -> tuple[tuple[str, ...], np.ndarray]:
    keep = np.isfinite(values).sum(axis=0) > 0
    return tuple(name for name, kept in zip(names, keep, strict=True) if kept), values[:, keep]


def _poses(table: RawTable, rows: np.ndarray) -> tuple[str, ...] | None:
    if "pose" not in table.texts:
        return None
    column = table.texts["pose"]
    poses = tuple(column[row] for row in rows)
    return poses if any(poses) else None


def _title(path: Path) -> str:
    name = path.name
    for suffix in (*_SUFFIXES, ".txt", ".tsv", ".dat", ".log"):
        if name.lower().endswith(suffix):
            name = name[: -len(suffix)]
            break
    return name.removesuffix(".frames") or path.name


def _take_name(key: str | None, name: str | None, title: str, *, alone: bool) -> str:
    if key is None:
        return name or title
    if name is None:
        return key
    return name if alone else f"{name}-{key}"


def _wearing(table: RawTable, rows: np.ndarray, stated: str | None) -> str:
    if "wearing" not in table.texts:
        return stated or ""
    column = table.texts["wearing"]
    first = column[rows[0]]
    for row in rows:
        if column[row] != first:
            raise table.error(
                f"{column[row]!r} after {first!r}; a take lies inside one wearing, so give each wearing "
                "a take of its own (column take)",
                row=int(row),
                column="wearing",
            )
    if stated is not None and stated != first:
        raise table.error(
            f"the file says {first!r}, but wearing {stated!r} was asked for; remove one",
            row=int(rows[0]),
            column="wearing",
        )
    return first


def _build_take(
    table: RawTable, rows: np.ndarray, name: str, wearing: str, own: ReferenceRows | None
) -> Take:
    time = table.time_s[rows]
    poses = _poses(table, rows)
    if own is None:
        rotations, reference = _only_measured(table.names("rotation"), table.matrix("rotation", rows))
        own = ReferenceRows(time, rotations, reference, None, _deviations(table, rows, rotations, reference))
    elif poses is None and own.poses is not None:
        poses = poses_at_frames(time, own.time_s, own.poses)
    measured = len(own.rotations) > 0
    names, values = _only_measured(table.names("context"), table.matrix("context", rows))
    context = dict(zip(names, values.T.copy(), strict=True))
    simulated = context.pop(SIMULATED_CONTEXT, np.zeros(1))
    return Take(
        name=name,
        wearing=wearing,
        sensors=table.names("sensor"),
        time_s=time,
        readings=table.matrix("sensor", rows),
        rotations=own.rotations,
        reference_time_s=own.time_s if measured else np.empty(0),
        reference=own.reference if measured else np.empty((0, 0)),
        reference_sd=own.reference_sd if measured else None,
        context=context,
        poses=poses,
        simulated=bool((np.nan_to_num(simulated) != 0).any()),
    )
