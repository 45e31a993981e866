"""What could these takes have shown?"""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, FiniteFloat

from glovecal_models.diagnosis.detectability.answer import Detectable
from glovecal_models.diagnosis.detectability.detection import SIZES_DEG, TRIALS, Detection
from glovecal_service.questions.question import AsOption, Question, WorkOnTakes
from glovecal_service.request_types import Channel, EffectName, Seed, StrictBody

Size = Annotated[FiniteFloat, Field(gt=0, le=90)]


class DetectabilityRequest(StrictBody):
    effects: Annotated[
        list[EffectName] | None, Field(min_length=1, max_length=32), AsOption(("--effect",))
    ] = None
    """Effect to put in; null: every one that a diagnosis compares."""
    rotations: Annotated[
        list[Channel] | None, Field(min_length=1, max_length=64), AsOption(("--rotation", "-r"))
    ] = None
    """Rotation to put it into by itself; null: into all at once."""
    sizes_deg: Annotated[list[Size], Field(min_length=1, max_length=12), AsOption(("--sizes",))] = Field(
        default=list(SIZES_DEG)
    )
    """Sizes, degrees RMS of what no static map explains."""
    trials: Annotated[int, Field(ge=1, le=50)] = TRIALS
    """Trials for each size."""
    seed: Seed = 0
    """Of noise, weights and controls."""


def work(on: WorkOnTakes, request: DetectabilityRequest) -> Detection:
    names = [*(request.effects or ()), *(item.name for item in on.own)]
    places = None if request.rotations is None else [(name,) for name in request.rotations]
    return Detection(on.on, names or None, places, request.sizes_deg, request.trials, request.seed)


QUESTION = Question(
    kind="detectability",
    verb="detectable",
    of=("model", "subject"),
    summary="Find how large effects must be to be named in these takes",
    help=(
        "Say how large an effect must be to be named in these takes, and which effects they cannot tell "
        "apart.\n\n"
        "The effect is put into the session's own readings, made perfect otherwise, with their noise as "
        "measured, and diagnosed again. One effect takes about half a minute for each rotation."
    ),
    request=DetectabilityRequest,
    answer=Detectable,
    work=work,
    own_effects="declarations",
)
