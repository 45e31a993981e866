"""A model, takes of its subject and layout that were measured, and what is left between them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from glovecal_models.calibration.explanation import chosen_rotations
from glovecal_models.comparison.residuals import Residuals, residuals
from glovecal_service.rest.http.dependencies import Parts
from glovecal_service.rest.model.comparison import Against, chosen
from glovecal_service.rest.model.model_takes import takes_for
from glovecal_service.store.records import ModelRecord, TakeRecord


@dataclass(frozen=True)
class ComparedTakes:
    model: ModelRecord
    takes: tuple[TakeRecord, ...]
    found: Residuals
    """In the order of ``takes``."""
    trained_on: frozenset[str]
    """Ids of those takes that the model was trained on."""


def compared_takes(id: str, takes: Sequence[str], rotation: str | None, parts: Parts) -> ComparedTakes:
    """Takes by id or name. Raises NotFound, Conflict, LayoutMismatch, NotTrainable (no reference angles),
    and BadInput for a ``rotation`` that the model does not have."""
    record = parts.store.models.get(id)
    rows = takes_for(parts.store, record, takes)
    _, model, _, seen = chosen(record.id, Against(takes=[row.id for row in rows]), parts)
    if rotation is not None:
        chosen_rotations(model, [rotation])
    found = residuals(model, [parts.store.takes.load(row.id) for row in rows])
    return ComparedTakes(record, tuple(rows), found, frozenset(seen))
