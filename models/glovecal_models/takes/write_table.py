"""Writing takes to CSV or Parquet, so that reading gives back exactly what was written."""

from __future__ import annotations

import csv
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

import numpy as np

from glovecal_models.errors import BadInput
from glovecal_models.takes.raw_table import parse_header, unusable_text
from glovecal_models.takes.read_table import load_pyarrow
from glovecal_models.takes.take import Take

SIMULATED_CONTEXT = "simulated"
"""The context column that marks simulated takes, so that no file of them passes for a recording."""

TableColumn = np.ndarray | list[str]
Write = Callable[[Iterable[Mapping[str, TableColumn]], Path], None]
"""Writes blocks of rows."""


def write_takes(takes: Sequence[Take], path: Path) -> list[Path]:
    """Write takes to ``path`` (.csv or .parquet) and return the files written.

    One file, unless a take's reference has a clock of its own: then ``X.frames.csv`` and
    ``X.reference.csv`` stand for ``X.csv``. Numbers keep every digit. Raises BadInput for takes that
    cannot share a file; a file already there is replaced only when the new one is complete.
    """
    write = _writer(path)
    _require_one_table(takes)
    measured = [take for take in takes if take.rotations and len(take.reference_time_s)]
    if not any(take.has_own_reference_clock for take in measured):
        _write_whole(write, _frames_columns(takes, with_reference=True), path)
        return [path]
    stem = path.name.removesuffix(path.suffix).removesuffix(".frames")
    frames = path.with_name(f"{stem}.frames{path.suffix}")
    reference = path.with_name(f"{stem}.reference{path.suffix}")
    _write_whole(write, _frames_columns(takes, with_reference=False), frames)
    _write_whole(write, _reference_columns(measured), reference)
    return [frames, reference]


def write_columns(blocks: Iterable[dict[str, np.ndarray]], path: Path) -> None:
    """A table (.csv or .parquet) of columns of any name, in blocks of rows, which all have the same columns;
    NaN is empty. Replaced whole or not at all."""
    _replaced(_writer(path), blocks, path)


def _require_one_table(takes: Sequence[Take]) -> None:
    if not takes:
        raise BadInput("there is no take to write")
    for take in takes:
        if not len(take.time_s):
            raise BadInput(f"take {take.name!r} has no frames; there is nothing to write")
        if take.sensors != takes[0].sensors or not take.sensors:
            raise BadInput(
                f"take {take.name!r} has sensors {', '.join(take.sensors)}, but take {takes[0].name!r} has "
                f"{', '.join(takes[0].sensors)}; write them to different files"
            )
        if SIMULATED_CONTEXT in take.context:
            raise BadInput(
                f"take {take.name!r}: context {SIMULATED_CONTEXT!r} is kept for the mark of simulated takes"
            )
    names = [take.name for take in takes]
    repeated = next((name for name in names if names.count(name) > 1), None)
    if repeated is not None:
        raise BadInput(f"two takes are named {repeated!r}; names within a file must differ")


def _frames_columns(takes: Sequence[Take], *, with_reference: bool) -> dict[str, TableColumn]:
    columns: dict[str, TableColumn] = {"time_s": np.concatenate([take.time_s for take in takes])}
    columns["take"] = [take.name for take in takes for _ in take.time_s]
    if any(take.wearing for take in takes):
        columns["wearing"] = [take.wearing for take in takes for _ in take.time_s]
    if any(take.poses and any(take.poses) for take in takes):
        columns["pose"] = [pose for take in takes for pose in take.poses or [""] * len(take.time_s)]
    readings = np.concatenate([take.readings for take in takes])
    columns |= {f"s.{name}": readings[:, index] for index, name in enumerate(takes[0].sensors)}
    if with_reference:
        columns |= _rotation_columns(takes, lambda take: len(take.time_s))
    for name in _union(tuple(take.context) for take in takes):
        parts = [take.context.get(name, np.full(len(take.time_s), np.nan)) for take in takes]
        columns[f"c.{name}"] = np.concatenate(parts)
    if any(take.simulated for take in takes):
        marks = [np.full(len(take.time_s), 1.0 if take.simulated else 0.0) for take in takes]
        columns[f"c.{SIMULATED_CONTEXT}"] = np.concatenate(marks)
    return columns


def _reference_columns(takes: Sequence[Take]) -> dict[str, TableColumn]:
    takes = [_without_reference_of_pre_roll(take) for take in takes]
    columns: dict[str, TableColumn] = {"time_s": np.concatenate([take.reference_time_s for take in takes])}
    columns["take"] = [take.name for take in takes for _ in take.reference_time_s]
    return columns | _rotation_columns(takes, lambda take: len(take.reference_time_s))


def _without_reference_of_pre_roll(take: Take) -> Take:
    """A table does not say where a take begins: a reference that is not to be read is not written."""
    if take.begins_s is None:
        return take
    kept = take.reference_time_s >= take.begins_s
    return replace(
        take,
        reference_time_s=take.reference_time_s[kept],
        reference=take.reference[kept],
        reference_sd=None if take.reference_sd is None else take.reference_sd[kept],
    )


def _rotation_columns(takes: Sequence[Take], rows: Callable[[Take], int]) -> dict[str, TableColumn]:
    columns: dict[str, TableColumn] = {}
    for name in _union(take.rotations for take in takes):
        for prefix, table in (("r", _angles), ("sd", _deviations)):
            parts = [
                _measured(take, table(take), name)
                if name in take.rotations and len(take.reference_time_s)
                else np.full(rows(take), np.nan)
                for take in takes
            ]
            if prefix == "r" or any(np.isfinite(part).any() for part in parts):
                columns[f"{prefix}.{name}"] = np.concatenate(parts)
    return columns


def _angles(take: Take) -> np.ndarray:
    return take.reference


def _deviations(take: Take) -> np.ndarray:
    return np.full_like(take.reference, np.nan) if take.reference_sd is None else take.reference_sd


def _measured(take: Take, table: np.ndarray, rotation: str) -> np.ndarray:
    values = table[:, take.rotations.index(rotation)]
    return (
        values if take.begins_s is None else np.where(take.reference_time_s < take.begins_s, np.nan, values)
    )


def _union(lists) -> list[str]:  # an iterable of tuples of names
    return list(dict.fromkeys(name for names in lists for name in names))


def _writer(path: Path) -> Write:
    suffix = path.suffix.lower()
    if suffix == ".csv":
        return _write_csv
    if suffix == ".parquet":
        load_pyarrow()
        return _write_parquet
    raise BadInput(
        f"{path.name}: takes are written to .csv or .parquet files, not to {suffix or 'a bare name'}"
    )


def _write_whole(write: Write, columns: dict[str, TableColumn], path: Path) -> None:
    _check_columns(columns, path)
    _replaced(write, [columns], path)


def _replaced(write: Write, blocks: Iterable[Mapping[str, TableColumn]], path: Path) -> None:
    part = path.with_name(f"{path.name}.part")
    try:
        write(blocks, part)
        os.replace(part, path)
    finally:
        part.unlink(missing_ok=True)


def _check_columns(columns: dict[str, TableColumn], path: Path) -> None:
    for column in parse_header(list(columns), path.name):
        values = columns[column.header]
        if isinstance(values, list):
            unusable = unusable_text(column, values)
            if unusable is not None:
                raise BadInput(f"{path.name}: column {column.header!r}: {unusable[1]}")
        elif np.isinf(values).any():
            raise BadInput(f"{path.name}: column {column.header!r} holds infinity; it must be finite or NaN")


def _write_csv(blocks: Iterable[Mapping[str, TableColumn]], path: Path) -> None:
    with path.open("w", encoding="utf-8", newline="") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        for number, columns in enumerate(blocks):
            if number == 0:
                writer.writerow(columns)
            cells = [
                values if isinstance(values, list) else _csv_numbers(values) for values in columns.values()
            ]
            writer.writerows(zip(*cells, strict=True))


def _csv_numbers(values: np.ndarray) -> list[float | str]:
    """Python floats, which csv writes with repr: the shortest text that reads back as the same number."""
    return ["" if value != value else value for value in values.astype(float).tolist()]


def _write_parquet(blocks: Iterable[Mapping[str, TableColumn]], path: Path) -> None:
    pyarrow = load_pyarrow()
    with ExitStack() as opened:
        writer = None
        for columns in blocks:
            arrays = [
                pyarrow.array(values, type=pyarrow.string())
                if isinstance(values, list)
                else pyarrow.array(values.astype(float), from_pandas=True)  # NaN becomes null: not measured
                for values in columns.values()
            ]
            table = pyarrow.table(arrays, names=list(columns))
            if writer is None:
                writer = opened.enter_context(pyarrow.parquet.ParquetWriter(path, table.schema))
            writer.write_table(table)
