"""What are the angles of one frame made of?"""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated

from pydantic import Field, FiniteFloat

from glovecal_models.calibration.answer import Explanation
from glovecal_service.questions.at_once import AskedAtOnce, AtOnce
from glovecal_service.questions.chosen_takes import takes_for
from glovecal_service.questions.question import AsOption
from glovecal_service.request_types import Channel, StrictBody, TakeReference

MOST_ROTATIONS = 512


class OneFrame(StrictBody):
    take: Annotated[TakeReference, AsOption(("--take", "-t"))]
    """Take: its name or id."""
    at_s: Annotated[FiniteFloat, AsOption(("--at",))]
    """Seconds by the take's clock; the nearest frame is explained."""
    rotations: Annotated[list[Channel], Field(max_length=MOST_ROTATIONS), AsOption(("--rotation", "-r"))] = (
        Field(default=[])
    )
    """Only these; empty: all of the model."""


def run(asked: AskedAtOnce[OneFrame]) -> Explanation:
    from glovecal_models.calibration.explanation import explain

    request, record = asked.request, asked.model
    model, _ = asked.predictors.get(record.id)
    (take,) = takes_for(asked.store, record, [request.take], measured=False)
    loaded = asked.store.takes.load(take.id)
    with asked.predictors.one_at_a_time:
        found = explain(model, loaded, request.at_s, request.rotations)
    return replace(found, model=record.id, method=record.method, take=take.id)


QUESTION = AtOnce(
    kind="explain",
    of="model",
    verb="explain",
    summary="What one frame's angles are made of",
    help=(
        "Say what an angle is made of: the base's value and what each effect adds, with standard deviations; "
        "they add up to the angle."
    ),
    request=OneFrame,
    answer=Explanation,
    run=run,
)
