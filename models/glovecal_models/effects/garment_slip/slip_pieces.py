"""An error's means over pieces of about 10 s, with the time since donning and what else was recorded."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from glovecal_models.effects.garment_slip.slip_rate import MEAN_S
from glovecal_models.takes.take import Take

MOST_PIECES = 160
FIRST_WORN_S = 30.0
"""A glove is recorded about so long after it was put on."""
PAUSE_S = 20.0
"""Between takes, where nothing tells the time."""
MEASURED_SHARE, COMPLETE_SHARE = 0.5, 0.9
"""A piece counts where so many of its frames were measured, and frames came in about as many of its seconds
as in those of the fullest. Not as many frames: where repeated ones were dropped, that would leave the few
pieces in which none were."""
POWER_ON = "power_on_s"


@dataclass(frozen=True)
class SlipPieces:
    """Means over pieces of takes; each array (P,)."""

    error: np.ndarray
    bend: np.ndarray
    worn_s: np.ndarray
    """Since donning."""
    inside_s: np.ndarray
    """Since the take's first frame."""
    take: np.ndarray
    wearing: np.ndarray
    context: dict[str, np.ndarray]
    """Columns that every take knows throughout, and that vary."""


def slip_pieces(
    takes: Sequence[Take], errors: Sequence[np.ndarray], angles: Sequence[np.ndarray]
) -> SlipPieces:
    """Of about ``MEAN_S``, longer in long sessions."""
    lasts_s = MEAN_S * max(1.0, sum(take.duration_s for take in takes) / (MEAN_S * MOST_PIECES))
    names = _context_names(takes)
    rows: list[np.ndarray] = []
    for number, (take, begins_s) in enumerate(zip(takes, _worn_s(takes), strict=True)):
        piece = np.floor((take.time_s - take.time_s[0]) / lasts_s).astype(int)
        known = np.isfinite(errors[number]) & np.isfinite(angles[number])
        every, count = np.bincount(piece), np.bincount(piece, known)
        begins_second = np.diff(np.floor(take.time_s - take.time_s[0]), prepend=-1.0) > 0
        seconds = np.bincount(piece, begins_second)
        is_complete = seconds >= COMPLETE_SHARE * seconds.max()
        good = (count >= MEASURED_SHARE * every) & is_complete & (count > 0)
        columns = (errors[number], angles[number], *(take.context[name] for name in names))
        total = [np.bincount(piece, np.where(known, column, 0.0))[good] / count[good] for column in columns]
        middle = lasts_s * (np.flatnonzero(good) + 0.5)
        rows.append(np.column_stack([np.full(len(middle), number), begins_s + middle, middle, *total]))
    take_of, worn_s, inside_s, error, bend, *context = np.concatenate(rows).T
    wearings = list(dict.fromkeys(take.wearing for take in takes))
    wearing = np.array([wearings.index(takes[int(number)].wearing) for number in take_of])
    columns = zip(names, context, strict=True)
    varied = {name: column for name, column in columns if column.size and np.ptp(column) > 1e-9}
    return SlipPieces(error, bend, worn_s, inside_s, take_of, wearing, varied)


def _context_names(takes: Sequence[Take]) -> list[str]:
    """Columns that every take knows throughout."""
    names = takes[0].context if takes else {}
    return [n for n in names if all(n in t.context and np.isfinite(t.context[n]).all() for t in takes)]


def _worn_s(takes: Sequence[Take]) -> list[float]:
    """How long the glove was worn when each take began, by the time since power-on where it was recorded."""
    found, last = [], {}
    for take in takes:
        on = take.context.get(POWER_ON)
        now = float(on[0]) if on is not None and np.isfinite(on[0]) else None
        begins_s = FIRST_WORN_S
        if take.wearing in last:
            began_s, power_s, lasted_s = last[take.wearing]
            begins_s = began_s + lasted_s + PAUSE_S
            if now is not None and power_s is not None:
                went_on = now - power_s >= lasted_s
                begins_s = began_s + now - power_s if went_on else began_s + lasted_s + now
        found.append(begins_s)
        last[take.wearing] = (begins_s, now, take.duration_s)
    return found
