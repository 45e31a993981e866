"""How far the clocks of two hands' takes are apart, as REST and ``--json`` give it."""

from __future__ import annotations

import math
from dataclasses import asdict
from typing import Any

from pydantic import BaseModel, Field

from glovecal_models.takes.hand_clocks import HandAlignment, How, TakeClock
from glovecal_models.takes.text import alignment_sentence


class OwnClockView(BaseModel):
    """A glove's own clock against the capture computer's."""

    kind: str = Field(description='"own" or "ltc".')
    drift_ppm: float
    drift_sd_ppm: float
    sd_s: float
    span_s: float


class HandAlignmentView(BaseModel):
    how: How
    shift_s: float = Field(description="Added to the second take's times at `at_s`, seconds.")
    drift_ppm: float = Field(description="And so many millionths of the time since `at_s`.")
    at_s: float
    sd_s: float | None = Field(
        description="Standard deviation of the shift; null where nothing was measured."
    )
    own_clocks: list[OwnClockView | None] = Field(description="Of each take, first and second.")
    sentence: str


def hand_alignment_view(found: HandAlignment, clocks: tuple[TakeClock, TakeClock]) -> dict[str, Any]:
    """Raises nothing: what is not known is null."""
    known = asdict(found) | {"drift_ppm": 1e6 * found.drift}
    known.pop("drift")
    return known | {
        "sd_s": None if math.isnan(found.sd_s) else found.sd_s,
        "own_clocks": [None if clock.own is None else dict(clock.own) for clock in clocks],
        "sentence": alignment_sentence(found, clocks),
    }
