"""A store as a site has it after years: 100,000 models, 50,000 takes and 100,000 jobs of 10,000 people.

Rows carry their hashes and every artifact that they name is there, as short as it can be: of the newest
models it is a whole one, of the others a few bytes, and all takes share one. Only so can it be made
in a minute.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from itertools import islice
from pathlib import Path
from typing import Any

from sqlalchemy import Connection, Table, insert
from stored_takes import LAYOUT, make_take

from glovecal_models.calibration.artifact import dump
from glovecal_models.calibration.training import train
from glovecal_models.calibration.training_settings import TrainingSettings
from glovecal_models.sampling.catalogue import make_protocol
from glovecal_models.sampling.engine import begin_sampling
from glovecal_service.settings import Settings
from glovecal_service.store import tables
from glovecal_service.store.row_hash import HASH, row_hash
from glovecal_service.store.store import Store
from glovecal_service.store.take_file import dump_take

AT_ONCE = 2000
WHOLE_MODELS = 100
"""The newest, which pages open."""
BEGAN = datetime(2026, 1, 1, tzinfo=UTC)
A_STEP = timedelta(seconds=97)
RESULT = {"rotations": {f"R{number}": {"rmse_deg": 1.25, "floor_deg": 0.5} for number in range(22)}}


@dataclass(frozen=True)
class Size:
    subjects: int = 10_000
    models: int = 100_000
    takes: int = 50_000
    jobs: int = 100_000
    samplings: int = 5_000

    def divided(self, by: int) -> Size:
        return Size(*(each // by for each in vars(self).values()))

    def __str__(self) -> str:
        return ", ".join(f"{count:,} {name}" for name, count in vars(self).items())


def fill(settings: Settings, size: Size) -> None:
    """Each take has the recording that it came from; one model of each person is active."""
    with Store.open(settings) as store:
        store.layouts.put(LAYOUT)
        take = make_take(1)
        artifact = store.artifacts.put(dump_take(take))
        whole = _whole_models(size)
        for content in whole.values():
            store.artifacts.put(content)
        folder = settings.artifacts_folder
        contents = [whole.get(number, b"model %d" % number) for number in range(size.models)]
        ids = [hashlib.sha256(content).hexdigest() for content in contents]
        for number, content in enumerate(contents):
            if number not in whole:  # not synced one by one, which is what takes long
                Path(folder, ids[number]).write_bytes(content)
        state = begin_sampling(make_protocol("fk_only", LAYOUT), LAYOUT.sensors).to_document()
        with store.database.engine.begin() as connection:
            _add(connection, tables.subjects, size.subjects, _subject)
            _add(connection, tables.recordings, size.takes, lambda number: _recording(number, size))
            _add(connection, tables.takes, size.takes, lambda number: _take(number, size, artifact))
            _add(connection, tables.models, size.models, lambda number: _model(number, size, ids))
            active = range(max(0, size.models - size.subjects), size.models)
            _add(connection, tables.activations, len(active), lambda n: _activation(active[n], size, ids))
            _add(connection, tables.jobs, size.jobs, lambda number: _job(number, size, ids))
            _add(connection, tables.job_events, size.jobs, _event)
            _add(connection, tables.samplings, size.samplings, lambda number: _sampling(number, size, state))


def _whole_models(size: Size) -> dict[int, bytes]:
    made = {}
    for number in range(max(0, size.models - WHOLE_MODELS), size.models):
        settings = TrainingSettings(method="linear", folds=0)
        made[number] = dump(train([make_take(number)], LAYOUT, _name(number, size), settings))
    return made


def _add(connection: Connection, table: Table, count: int, row: Callable[[int], Mapping[str, Any]]) -> None:
    def rows() -> Iterator[dict[str, Any]]:
        for number in range(count):
            values = {column.name: None for column in table.columns if column.nullable} | dict(row(number))
            yield values | ({HASH: row_hash(table, values)} if HASH in table.columns else {})

    every = rows()
    while part := list(islice(every, AT_ONCE)):
        connection.execute(insert(table), part)


def _id(kind: str, number: int) -> str:
    return hashlib.sha256(f"{kind} {number}".encode()).hexdigest()[:12]


def _at(number: int) -> datetime:
    return BEGAN + number * A_STEP


def _name(number: int, size: Size) -> str:
    return f"p{number % max(1, size.subjects):06d}"


def _subject(number: int) -> dict[str, Any]:
    return {
        "name": f"p{number:06d}", "title": f"Person {number}", "dimensions": {}, "hand": "right",
        "created_at": _at(number),
    }  # fmt: skip


def _recording(number: int, size: Size) -> dict[str, Any]:
    facts = {"sent": 300, "recorded": 300, "missing": 0, "take": _id("take", number)}
    return {
        "id": _id("recording", number), "glove": f"g{number % 500:03d}", "name": f"walk {number}",
        "subject": _name(number, size), "wearing": "first", "state": "done", "facts": facts,
        "requested_at": _at(number), "updated_at": _at(number),
    }  # fmt: skip


def _take(number: int, size: Size, artifact: str) -> dict[str, Any]:
    return {
        "id": _id("take", number), "name": f"walk {number}", "subject": _name(number, size),
        "layout": LAYOUT.name, "wearing": "first", "source": "recording", "artifact": artifact,
        "frames_sha256": hashlib.sha256(b"frames %d" % number).hexdigest(),
        "sensors": list(LAYOUT.sensors), "rotations": ["I_MCP", "I_PIP", "IM_ABD"], "context": ["supply_v"],
        "frames": 300, "reference_rows": 300, "duration_s": 4.98, "simulated": True,
        "recording": _id("recording", number), "accounting": {"sent": 300, "complete": True, "hand": "right"},
        "facts": {"note": f"note {number}"}, "created_at": _at(number),
    }  # fmt: skip


def _model(number: int, size: Size, ids: list[str]) -> dict[str, Any]:
    parent = number - size.subjects
    facts = {
        "takes": [{"id": _id("take", number % size.takes), "name": "walk"}], "held_out_rmse_deg": 2.5,
        "rotations": RESULT["rotations"], "sentences": ["Trained on one take."] * 3, "seconds": 12.5,
    }  # fmt: skip
    return {
        "id": ids[number], "subject": _name(number, size), "layout": LAYOUT.name, "method": "linear",
        "parent": ids[parent] if parent >= 0 else None, "facts": facts, "created_at": _at(number),
        "hand": "right",
    }  # fmt: skip


def _activation(number: int, size: Size, ids: list[str]) -> dict[str, Any]:
    return {
        "subject": _name(number, size), "layout": LAYOUT.name, "model": ids[number], "kind": "activate",
        "created_at": _at(number), "hand": "right",
    }  # fmt: skip


def _job(number: int, size: Size, ids: list[str]) -> dict[str, Any]:
    at, model = _at(number), ids[number % len(ids)]
    return {
        "id": _id("job", number), "kind": "train", "subject": _name(number, size),
        "payload": {"subject": _name(number, size), "takes": [_id("take", number % size.takes)]},
        "state": "done", "attempt": 1, "losses": 0, "owner": "worker", "cancel_requested": False,
        "fraction": 1.0, "sentence": "done", "detail": {}, "result": {"model": model, **RESULT},
        "created_at": at, "started_at": at, "finished_at": at + A_STEP, "updated_at": at + A_STEP,
    }  # fmt: skip


def _event(number: int) -> dict[str, Any]:
    return {
        "job": _id("job", number), "attempt": 1, "state": "done", "fraction": 1.0, "sentence": "done",
        "detail": {}, "created_at": _at(number),
    }  # fmt: skip


def _sampling(number: int, size: Size, document: dict[str, Any]) -> dict[str, Any]:
    return {
        "id": _id("sampling", number), "glove": f"g{number % 500:03d}", "subject": _name(number, size),
        "wearing": "first", "layout": LAYOUT.name, "open": False, "version": 1, "document": document,
        "recordings": [], "takes": [], "live": {}, "problem": "", "created_at": _at(number),
        "updated_at": _at(number),
    }  # fmt: skip
