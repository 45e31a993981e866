"""The recording that would decide between causes."""

from __future__ import annotations

from pydantic import Field

from glovecal_models.diagnosis.next_take import NextTake
from glovecal_service.views.view import View


class NextTakeView(View):
    what: str = Field(description="The instruction, for the wearer.")
    seconds: int
    separates: list[str] = Field(description='Effects; "chance" where takes are too few for significance.')

    @classmethod
    def of(cls, take: NextTake | None) -> NextTakeView | None:
        if take is None:
            return None
        return cls(what=take.what, seconds=take.seconds, separates=list(take.separates))
