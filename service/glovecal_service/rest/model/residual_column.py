"""``models/{id}/residual``: one rotation's error against a recorded column, and what chance reaches."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from fastapi import APIRouter
from pydantic import Field

from glovecal_models.comparison.dependence import covariates, dependence, joint_columns
from glovecal_models.errors import BadInput
from glovecal_service.rest.http.answers import change_problems
from glovecal_service.rest.http.dependencies import PartsNeeded
from glovecal_service.rest.http.request_types import ONE_LINE, Channel, ModelInPath, StrictBody
from glovecal_service.rest.model.compared_takes import compared_takes
from glovecal_service.rest.model.model_takes import TakesNamed
from glovecal_service.views.residual_column import ResidualColumnView, residual_column_view

router = APIRouter(prefix="/models", tags=["models"])


class OneColumn(StrictBody):
    takes: TakesNamed
    rotation: Channel
    column: Annotated[str, Field(min_length=1, max_length=200, pattern=ONE_LINE)] = Field(
        "angle",
        description="`angle`, `speed`, `direction`, `time in take`, `time since power-on`, `sensor NAME`, "
        "`context NAME` or `joint NAME`; the answer lists all.",
    )
    seed: Annotated[int, Field(ge=0, le=2**31 - 1)] = Field(0, description="Of the circular shifts.")


@router.post(
    "/{id}/residual",
    response_model=ResidualColumnView,
    summary="One rotation's error against a recorded column",
    responses=change_problems(409),
)
def residual_against_column(id: ModelInPath, body: OneColumn, parts: PartsNeeded) -> ResidualColumnView:
    """Mean error in bins of the column, and how far 95 % of circularly shifted errors take such a mean.

    422 for a rotation that none of the takes measured and for a column that they do not have.
    """
    on = compared_takes(id, body.takes, body.rotation, parts)
    if body.rotation not in on.found.measured_rotations:
        raise BadInput(f"none of the takes measured {body.rotation}")
    columns = [*covariates(on.found, body.rotation), *joint_columns(on.found, body.rotation)]
    chosen = next((one for one in columns if one.name == body.column), None)
    if chosen is None:
        names = ", ".join(one.name for one in columns)
        raise BadInput(f"these takes have no column {body.column!r}; there are {names}")
    number = on.found.column(body.rotation)
    errors = tuple(item.error[:, number] for item in on.found.takes)
    tested = dependence(errors, chosen, np.random.default_rng(body.seed))
    return residual_column_view(on.found, on.model.id, body.rotation, columns, chosen, tested)
