"""One effect put into a session: what it adds to the sensors, scaled to a size in degrees.

What a static map explains of it is left out, as any calibration takes it up; the RMS of the rest is its size.
The shape is the middle of the effect's own grid, weights are drawn as the effect declares them; delays shift
the reference instead.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from glovecal_models.diagnosis.detectability.surrogate_session import SurrogateSession
from glovecal_models.diagnosis.known_effect import one_lane
from glovecal_models.diagnosis.next_take import SINGLE_POSES, undecidable
from glovecal_models.effects.base.assessment import Assessment
from glovecal_models.effects.base.effect import (
    CorrectionEffect,
    Effect,
    is_between_takes,
    kind_of,
    needs_movement,
    why_not_shown,
)
from glovecal_models.effects.base.signals import Settings, Signals
from glovecal_models.effects.catalogue import relations
from glovecal_models.takes.take import Take

COMPARED_DELAY_S = 0.15
"""Larger ones are found by a scan of the clocks before anything is compared."""
BISECTIONS = 30
VISIBLE_SHARE = 1e-3
"""Of the RMS that an effect adds: when a static map explains all but this, nothing of it shows."""


@dataclass(frozen=True)
class Injected:
    """What one effect adds."""

    added: Mapping[str, Sequence[np.ndarray]]
    """By rotation, for each take (N,) degrees at the even times, NaN where not measured."""
    delays_s: Sequence[float] | None = None
    """How late the readings of each take are; None for effects of another kind."""


def is_delay(effect: Effect) -> bool:
    """Whether it is repaired by shifting the reference, so that it can be put in by shifting it."""
    probe = Assessment(effect.name, ("",), (), (np.array([0.01]),), (np.empty(0),))
    return effect.comparison is not None and effect.comparison.reference_delay_s(probe) is not None


def why_not_injected(session: SurrogateSession, effect: Effect) -> str | None:
    """Why the effect cannot be put into these takes and be found, as the end of a sentence; None if it can.

    That does not depend on its size.
    """
    if kind_of(effect) == "nothing":
        return "it is the absence of any effect"
    has = [item.effect.name for item in session.on.known]
    if effect.name in has or not set(has).isdisjoint(relations().alike_to(effect.name)):
        return "the model has it, or an effect like it, already"
    if not isinstance(effect, CorrectionEffect) and not is_delay(effect):
        return "it is found by its signature in a recording, not by what it explains of the error"
    if not session.sensors and not is_delay(effect):
        return "no rotation has a working sensor of its own"
    if effect.comparison is None:
        return "a diagnosis does not compare it with others"
    if session.problem.is_sparse and needs_movement(effect):
        return SINGLE_POSES
    signals = session.design.signals
    why = why_not_shown(effect, signals)
    if why is None and isinstance(effect, CorrectionEffect) and is_between_takes(effect):
        few = undecidable(signals, effect, session.limits)
        why = None if few is None else few.why
    return why


def where_injected(
    session: SurrogateSession, effect: Effect | None, rotations: Sequence[str] | None
) -> tuple[str, ...]:
    """The rotations that are changed at once; None: all. A delay is always on all that were measured.

    Raises BadInput for a rotation that cannot be rewritten.
    """
    where = tuple(session.sensors) if rotations is None else tuple(rotations)
    for rotation in where:
        session.joint(rotation)
    return session.rotations if effect is not None and is_delay(effect) else where


def injected(
    session: SurrogateSession,
    effect: Effect,
    rotations: Sequence[str],
    size_deg: float,
    generator: np.random.Generator,
) -> Injected | None:
    """The effect on each of ``rotations``, by itself ``size_deg`` on each of them.

    A delay is of that size over all rotations together. None where these takes cannot hold so much of it.
    Raises BadInput for a rotation that cannot be rewritten.
    """
    if not isinstance(effect, CorrectionEffect):
        return _delayed(session, effect, size_deg, generator)
    added: dict[str, list[np.ndarray]] = {}
    for rotation in rotations:
        joint = session.joint(rotation)
        plain = columns_of(session.design.signals, session.design.known, effect, joint)
        weights = effect.dynamics.drawn_weights(plain.prior_sd, generator)
        parts = [part @ weights for part in plain.parts]
        left = session.unexplained(joint, parts)
        rms = _rms(np.concatenate([part[np.isfinite(part)] for part in left]))
        if rms <= VISIBLE_SHARE * max(_rms(np.concatenate(parts)), 1e-12):
            return None
        added[rotation] = [size_deg / rms * part for part in left]
    return Injected(added)


@dataclass(frozen=True)
class EffectColumns:
    """The columns of one effect on one joint, at the middle of its grid."""

    parts: list[np.ndarray]
    """For each take (N, C)."""
    prior_sd: np.ndarray
    """(C,)."""
    settings: Settings


def columns_of(
    signals: Sequence[Signals], known: Sequence[frozenset[str]], effect: CorrectionEffect, joint: int
) -> EffectColumns:
    """``known``: for each joint, names among the other signals that its base reads already."""
    single = [one_lane(take, joint) for take in signals]
    if effect.comparison.is_joint_by_joint:
        single = [
            replace(take, others={k: v for k, v in take.others.items() if k not in known[joint]})
            for take in single
        ]
    settings = effect.fit_constants(single)
    grid = effect.shape.grid(single, settings)
    shape = grid[len(grid) // 2]
    parts = [effect.columns(take, settings, shape)[:, 0, :] for take in single]
    return EffectColumns(parts, effect.weights(settings).prior_sd, settings)


def delayed_by(signals: Sequence[Signals], joint: int, delay_s: float) -> list[np.ndarray]:
    """For each take (N,): the joint so much later minus the joint, degrees."""
    own = [(take.time_s, take.own[:, joint]) for take in signals]
    return [np.interp(time - delay_s, time, angle) - angle for time, angle in own]


def _delayed(
    session: SurrogateSession, effect: Effect, size_deg: float, generator: np.random.Generator
) -> Injected | None:
    """One delay of all takes: what it adds grows with it."""
    lowest = min((item.low for item in effect.shape.parameters), default=-1.0)
    sign = 1.0 if lowest >= 0 else float(generator.choice([-1.0, 1.0]))

    def size(delay_s: float) -> float:
        moved = [
            part
            for joint in range(len(session.rotations))
            for part in session.unexplained(joint, delayed_by(session.design.signals, joint, delay_s))
        ]
        return _rms(np.concatenate([part[np.isfinite(part)] for part in moved]))

    low, high = 0.0, COMPARED_DELAY_S
    if size(sign * high) < size_deg:
        return None
    for _ in range(BISECTIONS):
        middle = (low + high) / 2
        low, high = (middle, high) if size(sign * middle) < size_deg else (low, middle)
        if high - low < 1e-4:
            break
    return Injected({}, [sign * high] * len(session.on.takes))


def injected_takes(
    session: SurrogateSession, item: Injected | None, generator: np.random.Generator
) -> tuple[Take, ...]:
    """The session with the effect put in (None: with nothing), and its own noise from other moments."""
    noise = session.noise(generator)
    if item is None:
        return session.takes({}, noise)
    return session.takes(item.added, noise, item.delays_s)


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2))) if len(values) else 0.0
