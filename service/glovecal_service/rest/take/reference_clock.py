"""Reference angles measured by another computer: from its clock to the take's."""

from __future__ import annotations

from typing import Literal

import numpy as np

from glovecal_service.rest.http.problem import Problem
from glovecal_service.store.records import TakeRecord

ReferenceClock = Literal["take", "wall"]
"""``take``: seconds as in the take's own ``time_s``; ``wall``: Unix seconds."""


def on_take_clock(time_s: np.ndarray, clock: ReferenceClock, record: TakeRecord) -> np.ndarray:
    """``time_s`` (N,) in the take's own seconds. Raises Problem 409 for a take without a wall clock."""
    if clock == "take":
        return time_s
    offset = (record.accounting or {}).get("wall_minus_time_s")
    if not isinstance(offset, int | float):
        raise Problem(
            409,
            "no-wall-clock",
            f"take {record.id} ({record.name!r}) does not know when it was recorded; only takes recorded by "
            "the service do. Give the reference in the take's own time_s with clock=take.",
        )
    return time_s - float(offset)
