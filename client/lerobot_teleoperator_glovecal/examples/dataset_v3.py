"""Writes recorded episodes as a LeRobot dataset, version 3.0, with pyarrow alone.

    meta/info.json  meta/stats.json  meta/tasks.parquet  meta/episodes/chunk-000/file-000.parquet
    data/chunk-000/file-000.parquet

As LeRobot has it, a frame's time is its number in the episode divided by the frame rate.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow
from pyarrow import parquet

VERSION = "v3.0"
QUANTILES = (0.01, 0.1, 0.5, 0.9, 0.99)
_FIRST = {"chunk_index": 0, "file_index": 0}
_FILE = "chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
_COUNTS = ("frame_index", "episode_index", "index", "task_index")
_CHUNK_FILES, _DATA_FILE_MB, _VIDEO_FILE_MB = 1000, 100, 200
"""What LeRobot has unless told otherwise; one file holds a day of a hand."""


@dataclass(frozen=True)
class Episode:
    """F frames of J joints."""

    states: np.ndarray
    """(F, J) float32 where the robot was, before it was told."""
    actions: np.ndarray
    """(F, J) float32 what it was told."""


def write_dataset(
    folder: Path, episodes: Sequence[Episode], *, names: Sequence[str], fps: int, task: str, robot: str
) -> None:
    """``folder`` must not exist yet. Raises FileExistsError, ValueError without a frame."""
    if not episodes or not all(len(episode.actions) for episode in episodes):
        raise ValueError("a dataset has at least one episode, and each has at least one frame")
    folder.mkdir(parents=True)
    columns = [_columns(episode, number, fps) for number, episode in enumerate(episodes)]
    lengths = [len(episode.actions) for episode in episodes]
    ends = np.cumsum(lengths).tolist()
    for column, end in zip(columns, ends, strict=True):
        column["index"] = np.arange(end - len(column["index"]), end)
    whole = {name: np.concatenate([column[name] for column in columns]) for name in columns[0]}
    _write(folder / "data", pyarrow.table({name: _array(values) for name, values in whole.items()}))
    rows = [
        {
            "episode_index": number, "tasks": [task], "length": length,
            **{f"data/{name}": value for name, value in _FIRST.items()},
            "dataset_from_index": end - length, "dataset_to_index": end,
            **{f"meta/episodes/{name}": value for name, value in _FIRST.items()},
            **{
                f"stats/{feature}/{kind}": value
                for feature, values in column.items()
                for kind, value in _statistics(values).items()
            },
        }
        for number, (length, end, column) in enumerate(zip(lengths, ends, columns, strict=True))
    ]  # fmt: skip
    _write(folder / "meta" / "episodes", pyarrow.Table.from_pylist(rows))
    parquet.write_table(_tasks(task), folder / "meta" / "tasks.parquet")
    statistics = {name: _statistics(values) for name, values in whole.items()}
    _write_json(folder / "meta" / "stats.json", statistics)
    info = {
        "codebase_version": VERSION, "robot_type": robot, "total_episodes": len(episodes),
        "total_frames": ends[-1], "total_tasks": 1, "chunks_size": _CHUNK_FILES,
        "data_files_size_in_mb": _DATA_FILE_MB, "video_files_size_in_mb": _VIDEO_FILE_MB, "fps": fps,
        "splits": {"train": f"0:{len(episodes)}"}, "data_path": f"data/{_FILE}", "video_path": None,
        "features": {
            **{name: _feature("float32", len(names), names) for name in ("action", "observation.state")},
            "timestamp": _feature("float32", 1), **{name: _feature("int64", 1) for name in _COUNTS},
        },
    }  # fmt: skip
    _write_json(folder / "meta" / "info.json", info)


def _columns(episode: Episode, number: int, fps: int) -> dict[str, np.ndarray]:
    count = len(episode.actions)
    return {
        "action": episode.actions.astype(np.float32),
        "observation.state": episode.states.astype(np.float32),
        "timestamp": (np.arange(count) / fps).astype(np.float32),
        "frame_index": np.arange(count),
        "episode_index": np.full(count, number),
        "index": np.arange(count),
        "task_index": np.zeros(count, np.int64),
    }


def _array(values: np.ndarray) -> pyarrow.Array:
    if values.ndim == 1:
        return pyarrow.array(values)
    return pyarrow.FixedSizeListArray.from_arrays(pyarrow.array(values.reshape(-1)), values.shape[1])


def _statistics(values: np.ndarray) -> dict[str, list[Any]]:
    """By joint; ``count``: of frames."""
    rows = values.reshape(len(values), -1).astype(float)
    quantiles = np.quantile(rows, QUANTILES, axis=0)
    return {
        "min": rows.min(axis=0).tolist(), "max": rows.max(axis=0).tolist(),
        "mean": rows.mean(axis=0).tolist(), "std": rows.std(axis=0).tolist(), "count": [len(rows)],
        **{f"q{100 * share:02.0f}": row.tolist() for share, row in zip(QUANTILES, quantiles, strict=True)},
    }  # fmt: skip


def _feature(dtype: str, size: int, names: Sequence[str] | None = None) -> dict[str, Any]:
    return {"dtype": dtype, "shape": [size], "names": None if names is None else list(names)}


def _tasks(task: str) -> pyarrow.Table:
    """LeRobot finds a task by its words: pandas is told that they are the index."""
    columns = [
        {"name": "task", "field_name": "task", "pandas_type": "unicode", "numpy_type": "object"},
        {"name": "task_index", "field_name": "task_index", "pandas_type": "int64", "numpy_type": "int64"},
    ]
    known = {"index_columns": ["task"], "column_indexes": [], "columns": columns, "pandas_version": "2.0.0"}
    return pyarrow.table({"task_index": [0], "task": [task]}).replace_schema_metadata(
        {"pandas": json.dumps(known)}
    )


def _write(folder: Path, table: pyarrow.Table) -> None:
    place = folder / _FILE.format(**_FIRST)
    place.parent.mkdir(parents=True)
    parquet.write_table(table, place)


def _write_json(place: Path, document: dict[str, Any]) -> None:
    place.write_text(json.dumps(document, indent=4), encoding="utf-8")
