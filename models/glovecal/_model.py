"""A calibration model to be shown, saved and loaded."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from glovecal._layouts import LayoutLike, layout_for
from glovecal._shown import Shown
from glovecal._table import Column, Table
from glovecal_models.errors import BadInput, reason_of
from glovecal_models.layout import Layout
from glovecal_models.presentation.document import AboutTakes, TakeNamed
from glovecal_models.takes.take import Take

if TYPE_CHECKING:
    from glovecal_models.calibration.model import CalibrationModel as InnerModel
    from glovecal_models.diagnosis.model_on_takes import ModelOnTakes
    from glovecal_models.effects.base.effect import Effect

Found = TypeVar("Found", bound=AboutTakes)

COLUMNS = (
    Column("rotation"), Column("read_from"), Column("samples"), Column("held_out_rmse_deg"),
    Column("effects"),
)  # fmt: skip


@dataclass(frozen=True, eq=False, repr=False)
class CalibrationModel(Shown):
    """The map from readings to rotations of one person and one glove. Immutable."""

    inner: InnerModel
    """The model itself, ``glovecal_models.calibration.model.CalibrationModel``: regressors and effects."""

    @cached_property
    def id(self) -> str:
        """sha256 of the model's artifact, 64 hexadecimal digits."""
        from glovecal_models.calibration.artifact import dump, model_id

        return model_id(dump(self.inner))

    @property
    def layout(self) -> Layout:
        """Its sensors and rotations."""
        return self.inner.layout

    @property
    def subject(self) -> str:
        """Whose hand."""
        return self.inner.subject

    @property
    def method(self) -> str:
        """How it was trained, such as ``lmc_gpr``."""
        return self.inner.method

    @property
    def rotations(self) -> tuple[str, ...]:
        """What it predicts."""
        return self.inner.rotation_names

    @property
    def effects(self) -> tuple[str, ...]:
        """Names of the physical effects it corrects."""
        return tuple(dict.fromkeys(item.name for item in self.inner.effects))

    @property
    def held_out_rmse_deg(self) -> float | None:
        """Error over all rotations on takes left out of training, degrees; None if it was not estimated."""
        found = self.inner.error_estimate.get("rmse_deg")
        return None if found is None else float(found)

    @property
    def parent(self) -> str | None:
        """``id`` of the model it was derived from."""
        return self.inner.parent

    @property
    def simulated(self) -> bool:
        """Whether any take it was trained on came from a simulated glove."""
        return self.inner.simulated

    def table(self) -> Table:
        """One row for each rotation."""
        rows = [
            (
                item.rotation,
                ", ".join(item.correspondence.sensors),
                item.samples,
                item.held_out_rmse_deg,
                ", ".join(dict.fromkeys(e.name for e in self.inner.effects if item.rotation in e.active)),
            )
            for item in self.inner.rotations
        ]
        error = self.held_out_rmse_deg
        held_out = "no cross-validation" if error is None else f"held-out error {error:.2f} degrees"
        mark = ", SIMULATED" if self.simulated else ""
        title = f"Model {self.id[:12]} ({self.method}) of {self.subject}, {held_out}{mark}"
        return Table.of(COLUMNS, rows, before=[title])


def inner_model(model: CalibrationModel | InnerModel) -> InnerModel:
    """The model behind what was given. Raises BadInput when it is none."""
    from glovecal_models.calibration.model import CalibrationModel as InnerModel

    found = model.inner if isinstance(model, CalibrationModel) else model
    if not isinstance(found, InnerModel):
        raise BadInput(f"a calibration model is wanted, not a {type(model).__name__}")
    return found


def on_takes(
    takes: Sequence[Take],
    model: CalibrationModel | InnerModel | None = None,
    layout: LayoutLike = None,
    own: Sequence[Effect] = (),
) -> ModelOnTakes:
    """The takes as ``model`` reads them, or without one by themselves. Raises BadInput."""
    from glovecal_models.diagnosis.model_on_takes import ModelOnTakes

    if model is None:
        return ModelOnTakes(tuple(takes), layout_for(layout, takes), own=tuple(own))
    return ModelOnTakes.of(inner_model(model), takes, own)


def about(found: Found, takes: Sequence[Take], model: CalibrationModel | None = None) -> Found:
    """The answer with what was asked about."""
    return replace(
        found,
        takes=[TakeNamed("", take.name) for take in takes],
        simulated=any(take.simulated for take in takes),
        subject="" if model is None else model.subject,
        model=None if model is None else model.id,
        method=None if model is None else model.method,
    )


def save_model(model: CalibrationModel, path: str | PathLike[str]) -> str:
    """Write the model's artifact (safetensors, nothing pickled) and give its id, the sha256 of the file.

    A file already there is replaced only when the new one is complete. Raises BadInput when the folder cannot
    be written to.
    """
    from glovecal_models.calibration.artifact import dump, model_id

    content = dump(inner_model(model))
    path = Path(path)
    unfinished = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        unfinished.write_bytes(content)
        unfinished.replace(path)
    except OSError as error:
        unfinished.unlink(missing_ok=True)
        raise BadInput(f"model file {path}: cannot be written: {reason_of(error)}") from error
    return model_id(content)


def load_model(path: str | PathLike[str], *, sha256: str | None = None) -> CalibrationModel:
    """A model from its artifact's file. With ``sha256``, what ``save_model`` gave, a changed file is refused.

    Raises BadInput when there is no such file, and DamagedArtifact (a GlovecalError) when it is no model or
    not the one that ``sha256`` names.
    """
    from glovecal_models.calibration.artifact import load

    try:
        content = Path(path).read_bytes()
    except OSError as error:
        raise BadInput(f"model file {path}: cannot be read: {reason_of(error)}") from error
    return CalibrationModel(load(content, expected_id=sha256))
