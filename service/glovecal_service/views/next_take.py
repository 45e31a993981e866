"""The recording that would decide between causes."""

from __future__ import annotations

from pydantic import Field

from glovecal_models.diagnosis.next_take import MORE_TAKES, MORE_WEARINGS, NextTake
from glovecal_service.views.view import View

FREE_MOTION = "free-motion"


class NextTakeView(View):
    motion: str = Field(
        "", description="Its kind, such as ramps; taps is no take but `glovecal take latency`."
    )
    take_name: str = Field(
        "deciding",
        description="What to call it: a diagnosis tells by the name that no other take shows this motion.",
    )
    what: str = Field(description="The instruction, for the wearer.")
    seconds: int
    separates: list[str] = Field(description='Effects; "chance" where takes are too few for significance.')

    @classmethod
    def of(cls, take: NextTake | None) -> NextTakeView | None:
        if take is None:
            return None
        is_free = take.motion in (MORE_TAKES, MORE_WEARINGS)
        return cls(
            motion=take.motion,
            take_name=FREE_MOTION if is_free else take.motion.replace("_", "-"),
            what=take.what,
            seconds=take.seconds,
            separates=list(take.separates),
        )
