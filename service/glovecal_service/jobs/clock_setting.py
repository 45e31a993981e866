"""What a clock offset is set to when it is added by hand: each take's own offset, from the clock scan."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from glovecal_models.effects.clock_scan import clock_offsets
from glovecal_models.errors import BadInput
from glovecal_models.takes.take import Take


def clock_setting(takes: Sequence[Take]) -> dict[str, Any]:
    """Settings of the effect ``clock_offset``. Raises BadInput when no take's clock is off."""
    found = clock_offsets(takes)
    off = [item for item in found if item.verdict == "offset"]
    if not off:
        raise BadInput(
            f"effect 'clock_offset': no reference clock of these {len(takes)} takes is off; the scan says: "
            f"{found[0].sentence}"
        )
    return {
        "offset_s": {item.take: item.offset_s for item in found},
        "common_s": float(np.median([item.offset_s for item in off])),
        "per_take": True,
    }
