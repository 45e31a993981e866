"""A residual against one recorded column, as an answer shows it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict

import numpy as np
from pydantic import BaseModel, Field

from glovecal_models.comparison.dependence import Covariate, Dependence
from glovecal_models.comparison.residuals import Residuals
from glovecal_models.comparison.text import dependence_sentence
from glovecal_models.comparison.where_it_fails import is_structure
from glovecal_service.plain import plain
from glovecal_service.views.failures import DependenceView

MOST_POINTS = 1500


class ColumnView(BaseModel):
    name: str
    unit: str
    phrase: str = Field(description="As a sentence names it.")


class ResidualColumnView(BaseModel):
    model: str
    rotation: str
    column: ColumnView
    columns: list[ColumnView] = Field(description="All that the residual can be held against.")
    rmse_deg: float | None
    bias_deg: float | None
    dependence: DependenceView | None = Field(description="Null: the column has fewer than two values.")
    value: list[float] = Field(description="Of at most 1,500 frames, evenly chosen, in the column's unit.")
    error_deg: list[float] = Field(description="Predicted minus measured, of the same frames.")
    sentence: str


def residual_column_view(
    found: Residuals, model: str, rotation: str, columns: Sequence[Covariate], chosen: Covariate,
    dependence: Dependence | None,
) -> ResidualColumnView:  # fmt: skip
    """``dependence``: of the rotation's error on the ``chosen`` one of ``columns``."""
    error = found.stacked("error")[:, found.column(rotation)]
    value = np.concatenate(chosen.values)
    known = np.flatnonzero(np.isfinite(error) & np.isfinite(value))
    known = known[:: max(1, -(-len(known) // MOST_POINTS))]
    measured = error[np.isfinite(error)]
    rmse = float(np.sqrt(np.mean(measured**2)))
    shown, sentence = None, f"{chosen.name} has fewer than two values where {rotation} was measured."
    if dependence is not None:
        facts = plain(asdict(dependence)) | {"is_structure": is_structure(dependence, rmse)}
        shown = DependenceView.model_validate(facts)
        sentence = dependence_sentence(rotation, rmse, dependence)
    return ResidualColumnView(
        model=model,
        rotation=rotation,
        column=_column(chosen),
        columns=[_column(one) for one in columns],
        rmse_deg=rmse,
        bias_deg=float(np.mean(measured)),
        dependence=shown,
        value=value[known].tolist(),
        error_deg=error[known].tolist(),
        sentence=sentence,
    )


def _column(one: Covariate) -> ColumnView:
    return ColumnView(name=one.name, unit=one.unit, phrase=one.phrase)
