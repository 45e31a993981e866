"""A stored model and the takes it is worked on with: what a worker needs to know, as plain data."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

from glovecal_models.calibration.artifact import load
from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.training_settings import TrainingSettings
from glovecal_models.errors import BadInput, GlovecalError, NotTrainable
from glovecal_models.takes.take import Take
from glovecal_service.store import Store
from glovecal_service.store.errors import NotFound
from glovecal_service.store.records import ModelRecord, TakeRecord

SHORT = 30_000
"""Frames times rotations; a job of fewer ends before worker processes would have started."""
MONTHS = (
    *("January", "February", "March", "April", "May", "June", "July", "August", "September"),
    *("October", "November", "December"),
)
"""Whatever the locale."""


@dataclass(frozen=True)
class ModelWork:
    """``artifact`` is the model's bytes, of which ``id`` is the sha256."""

    id: str
    artifact: bytes
    takes: tuple[Take, ...]
    take_hashes: tuple[str, ...]
    settings: TrainingSettings
    """How the model was trained."""

    @classmethod
    def of(cls, store: Store, record: ModelRecord, takes: Sequence[TakeRecord]) -> ModelWork:
        """Raises DamagedArtifact, NotFound."""
        return cls(
            record.id,
            store.models.load_bytes(record.id),
            tuple(store.takes.load(take.id) for take in takes),
            tuple(take.artifact for take in takes),
            settings_of(record),
        )

    @property
    def model(self) -> CalibrationModel:
        return load(self.artifact, expected_id=self.id)

    @property
    def identity(self) -> dict[str, Any]:
        """What decides the results of work on it, beside what is asked."""
        left_out = [take.left_out for take in self.takes]
        return {"model": self.id, "takes": list(self.take_hashes), "left_out": left_out}

    @property
    def is_short(self) -> bool:
        return is_short(self.takes)


def is_short(takes: Sequence[Take]) -> bool:
    """Whether working on these takes ends before worker processes would have started."""
    return sum(len(take.time_s) * len(take.rotations) for take in takes) <= SHORT


def settings_of(record: ModelRecord) -> TrainingSettings:
    """Stored training settings; the defaults if none were stored."""
    kept: dict[str, Any] = record.facts.get("settings") or {"method": record.method}
    return TrainingSettings(**kept)


def leave_out_folds(settings: TrainingSettings | None) -> int:
    """In how many folds simpler calibrations beside a model leave takes out: as many as its own, at least
    two."""
    return max(2, 0 if settings is None else settings.folds)


def takes_of(store: Store, record: ModelRecord, ids: Any) -> list[TakeRecord]:
    """Takes by id; None: those the model was trained on. Raises NotFound, NotTrainable, BadInput."""
    if ids is None:
        ids = trained_ids(store, record)
    if not isinstance(ids, list) or not all(isinstance(id, str) for id in ids):
        raise BadInput(f"takes must be a list of take ids or null, not {ids!r}")
    found = [take for take in map(store.takes.get, dict.fromkeys(ids)) if take.has_reference]
    if not found:
        raise NotTrainable(f"model {record.id[:12]}: none of the takes has reference angles")
    return found


def stored_takes(store: Store, ids: Iterable[str]) -> list[TakeRecord]:
    """Those of ``ids`` that are still stored."""
    stored = []
    for id in ids:
        with suppress(NotFound):
            stored.append(store.takes.get(id))
    return stored


def named_takes(record: ModelRecord) -> list[str]:
    """Ids of the takes a model says it was trained on; none for one that came from elsewhere."""
    return [take["id"] if isinstance(take, Mapping) else take for take in record.facts.get("takes", [])]


def trained_ids(store: Store, record: ModelRecord) -> list[str]:
    """Ids of the takes a model was trained on. Raises NotFound when none of them is in the store."""
    named = named_takes(record)
    if not named:
        raise NotFound(f"the takes that model {record.id[:12]} was trained on are not stored; name some")
    return named


def model_title(store: Store, id: str) -> str:
    """A model as people call it: "anna, version 2 of 22 November 2026"; ``version`` counts it and those it
    was made from. Of one that can no longer be read "model 0123456789ab"."""
    try:
        line = store.models.lineage(id)
    except GlovecalError:
        return f"model {id[:12]}"
    made = line[0].created_at
    return f"{line[0].subject}, version {len(line)} of {made.day} {MONTHS[made.month - 1]} {made.year}"


def text_in(payload: Mapping[str, Any], name: str) -> str:
    """Raises BadInput unless the payload has that text."""
    value = payload.get(name)
    if not isinstance(value, str):
        raise BadInput(f"this job needs {name!r} as text, not {value!r}")
    return value
