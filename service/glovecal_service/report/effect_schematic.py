"""What an effect does to a reading, schematically: the reading without it and with it over a small motion.

No effect is known here by name. It comes from the effect's own columns over a motion that rises, holds and
falls; of an effect without columns from the simulation of the same name.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from glovecal_models.effects.base.effect import Effect
from glovecal_models.effects.base.signals import Signals
from glovecal_models.effects.catalogue import effect
from glovecal_models.errors import BadInput
from glovecal_models.simulation.session_plan import SessionPlan

RATE_HZ = 50
LOW_DEG, HIGH_DEG = 10.0, 70.0
SHOWN_DEG = 15.0
"""How far the schematic effect moves the reading."""
KNOTS_S = (0, 2, 4, 9, 10, 13, 15, 20, 22, 24)
KNOTS_SHARE = (0, 0, 1, 1, 0.5, 0.5, 1, 1, 0, 0)
SIMULATED = SessionPlan(
    seed=4, sensors=("I_MCP", "I_PIP"), wearings=1, takes_per_wearing=1, take_s=12, bits=14,
    nuisance="white", reference_white_deg=0, reference_lasting_deg=0, sensor_noise_deg=0,
)  # fmt: skip


@dataclass(frozen=True)
class Schematic:
    """N moments; sizes are for show."""

    time_s: np.ndarray
    without: np.ndarray
    """(N,): the reading, or the angle that is measured."""
    with_it: np.ndarray
    label: str
    """What the two are: "reading" or "measured angle"."""
    time_label: str


def schematic(known: Effect) -> Schematic | None:
    """None where neither columns nor a simulation show it."""
    try:
        in_catalogue = effect(known.name) is known
    except BadInput:
        in_catalogue = False
    return _of_name(known.name) if in_catalogue else _made(known)


@cache
def _of_name(name: str) -> Schematic | None:
    return _made(effect(name))


def _made(known: Effect) -> Schematic | None:
    shown = _by_columns(known) if known.has_columns else None
    return _by_simulation(known) if shown is None else shown


def _time_label(known: Effect) -> str:
    if known.context:
        return f"time; c.{known.context[0]} rises"
    return "time; glove put on again half-way" if known.changes_between_takes else "time"


def _by_columns(known: Effect) -> Schematic | None:
    """Two takes, the second in another wearing and context; the column that does most is the effect."""
    takes = [_ramp_and_hold(known, number) for number in range(2)]
    try:
        settings = known.fit_constants(takes)
        grid = known.grid(takes, settings)
        shape = grid[len(grid) // 2]
        columns = [known.columns(take, settings, shape)[:, 0] for take in takes]
        prior = known.prior_sd(settings)
    except (BadInput, KeyError, ValueError):
        return None
    if not known.context and not known.changes_between_takes:
        columns, takes = columns[:1], takes[:1]
    joined, own = np.concatenate(columns), np.concatenate([take.own[:, 0] for take in takes])
    if not joined.shape[1]:
        return None
    sizes = np.std(joined, axis=0) * prior
    column = joined[:, int(np.flatnonzero(sizes >= 0.999 * sizes.max())[-1])]
    largest = float(np.max(np.abs(column)))
    if not np.isfinite(largest) or largest == 0:
        return None
    weight = SHOWN_DEG / largest
    if known.has_memory and not known.context:
        # In degrees of the joint: more than all of it makes no sense, and a sensor comes late, never early.
        late = -float(np.sign(np.sum(column[1:] * np.diff(own))) or -1.0)
        weight = late * min(weight, 1.0)
    time = np.arange(len(own)) / RATE_HZ
    return Schematic(time, own, own + weight * column, "reading", _time_label(known))


def _ramp_and_hold(known: Effect, number: int) -> Signals:
    time = np.arange(0, KNOTS_S[-1], 1 / RATE_HZ)
    motion = LOW_DEG + (HIGH_DEG - LOW_DEG) * np.interp(time, KNOTS_S, KNOTS_SHARE)
    neighbour = 1.5 * np.sin(2 * np.pi * time / 7.0)
    rising = 1.0 + number + time / KNOTS_S[-1]
    context = dict.fromkeys(known.context, rising)
    return Signals(
        time, motion[:, None], {"neighbour": neighbour}, context, f"wearing {number + 1}",
        f"take {number + 1}", np.zeros(1),
    )  # fmt: skip


def _by_simulation(known: Effect) -> Schematic | None:
    """A simulated glove with and without the cause, where it does most; None where nobody simulates it."""
    # Slow to load, with scipy.signal, and every command and service loads this file.
    from glovecal_models.simulation.causes.catalogue import KNOWN_CAUSES, forms
    from glovecal_models.simulation.causes.form import Cause
    from glovecal_models.simulation.session import record_session

    if known.name not in KNOWN_CAUSES:
        return None
    session = record_session(SIMULATED, [Cause(known.name, forms(known.name)[0].name, strength_deg=6.0)])
    take, clean = session.takes[0], session.clean[0]
    label, pair = "reading", (clean.readings, take.readings)
    if np.array_equal(*pair) and take.reference is not None and clean.reference is not None:
        label, pair = "measured angle", (clean.reference, take.reference)
    if np.array_equal(*pair):
        return None
    channel = int(np.argmax(np.nanmax(np.abs(pair[1] - pair[0]), axis=0)))
    without, with_it = (np.asarray(part[:, channel], dtype=float) for part in pair)
    time = np.arange(len(without)) / SIMULATED.rate_hz
    return Schematic(time, without, with_it, label, _time_label(known))
