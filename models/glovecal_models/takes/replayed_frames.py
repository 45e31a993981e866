"""Frames that come a second time: a driver that has no data plays its ring buffer again.

Whole runs of frames then equal those of a moment before, in all columns, while the hand moves. The way back
is the length of the buffer and always the same; frames that happen to be equal lie any way back.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

SHORTEST_BACK, LONGEST_BACK = 2, 60
"""Frames; one frame back is a plain repeat."""
FEWEST_IN_A_RUN = 3
FEWEST_REPLAYED, LEAST_SHARE_REPLAYED = 20, 0.01
"""Of all takes' frames: a slow movement of coarse readings comes back the way it went for half a percent."""
BEYOND_OTHERS = 5.0
"""Times more often than any other way back."""


def replayed(values: Sequence[np.ndarray]) -> list[np.ndarray]:
    """(N,) of each take's rows (N, K), True where they come again; all False where no way back stands out."""
    none = [np.zeros(len(part), dtype=bool) for part in values]
    again = {
        back: [_equal_runs(part, back) for part in values] for back in range(SHORTEST_BACK, LONGEST_BACK + 1)
    }
    counts = {back: sum(int(part.sum()) for part in found) for back, found in again.items()}
    back = max(counts, key=lambda each: counts[each])
    others = max((count for each, count in counts.items() if each % back), default=0)
    least = max(FEWEST_REPLAYED, LEAST_SHARE_REPLAYED * sum(map(len, values)), BEYOND_OTHERS * others)
    return again[back] if counts[back] >= least else none


def _equal_runs(values: np.ndarray, back: int) -> np.ndarray:
    """(N,) whether a row is one of a run that equal those so many before, and are not all alike."""
    found = np.zeros(len(values), dtype=bool)
    if len(values) <= back or not values.shape[1]:
        return found
    at = back + np.flatnonzero(values[back:, 0] == values[:-back, 0])
    at = at[(values[at] == values[at - back]).all(axis=1)]
    for run in np.split(at, np.flatnonzero(np.diff(at) > 1) + 1):
        if len(run) >= FEWEST_IN_A_RUN and (np.diff(values[run], axis=0) != 0).any(axis=1).all():
            found[run] = True
    return found
