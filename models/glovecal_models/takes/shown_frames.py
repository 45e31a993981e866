"""Which frames of long series are drawn: few, and no extreme is lost."""

from __future__ import annotations

import numpy as np

KEPT_OF_EACH = 3
"""Of a column in a block of frames: its lowest, its highest, and one where it is unknown."""


def shown_frames(columns: np.ndarray, most: int) -> np.ndarray:
    """At most ``most`` frames of (N, C) columns, as increasing indexes, the first and the last among them.

    Of blocks of neighbouring frames those that hold each column's lowest and highest value, and one where it
    is NaN, so that a line breaks where nothing was measured. All frames where they are few enough; ``most``
    has room for one block at least, ``3 C + 2``.
    """
    frames, width = columns.shape
    if frames <= most:
        return np.arange(frames)
    blocks = max(1, (most - 2) // (KEPT_OF_EACH * width))
    kept = {0, frames - 1}
    for block in np.array_split(np.arange(frames), blocks):
        for column in columns[block].T:
            known = np.isfinite(column)
            if not known.all():
                kept.add(int(block[np.argmin(known)]))
            if known.any():
                kept.add(int(block[np.nanargmin(np.where(known, column, np.nan))]))
                kept.add(int(block[np.nanargmax(np.where(known, column, np.nan))]))
    return np.array(sorted(kept))
