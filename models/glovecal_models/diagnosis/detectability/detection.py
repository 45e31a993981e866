"""How often is an effect of known size named, when it is put into the session and that is diagnosed again?"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from glovecal_models.diagnosis.detectability.answer import (
    Confusability,
    Control,
    Detectable,
    EffectDetectability,
    Outcome,
    SizeTried,
    Trial,
)
from glovecal_models.diagnosis.detectability.confusability import confusability
from glovecal_models.diagnosis.detectability.injection import (
    injected,
    injected_takes,
    where_injected,
    why_not_injected,
)
from glovecal_models.diagnosis.detectability.surrogate_session import SurrogateSession
from glovecal_models.diagnosis.diagnosis import Diagnosis
from glovecal_models.diagnosis.model_on_takes import ModelOnTakes
from glovecal_models.effects.base.effect import Effect
from glovecal_models.effects.catalogue import catalogue, effect
from glovecal_models.errors import BadInput
from glovecal_models.names import did_you_mean
from glovecal_models.parts import Part, Parted
from glovecal_models.presentation.document import answer
from glovecal_models.progress import Cancel, Report

SIZES_DEG = (0.5, 1.0, 2.0, 4.0)
TRIALS = 3
MOST_DIAGNOSES = 5000
TRIALS_VERSION = 2
"""Of the trials: results of another one are not used again."""


@answer
class Alike:
    """Of a session, before anything is put in."""

    confusability: Confusability
    residual_deg: Mapping[str, float | None]


@answer
class Tried:
    """Trials of one effect at one size."""

    rotations: Sequence[str]
    trials: Sequence[Trial]
    why_not: str | None = None


@dataclass(frozen=True)
class Detection(Parted[Detectable]):
    """Effects of known size put into takes that are made perfect otherwise, and diagnosed again."""

    on: ModelOnTakes
    effects: Sequence[str] | None = None
    """Names, of the catalogue or declared in ``on``; None: every effect that a diagnosis compares."""
    places: Sequence[Sequence[str]] | None = None
    """Rotations that an effect is put into at once, one set after the other; None: all."""
    sizes_deg: Sequence[float] = SIZES_DEG
    trials: int = TRIALS
    """For each size."""
    seed: int = 0

    def require(self) -> None:
        """Raises BadInput for an effect or a rotation that there is not, and for too many diagnoses."""
        self.parts()

    def parts(self) -> list[Part]:
        common = {"seed": self.seed, "trials": self.trials, "version": TRIALS_VERSION}
        pieces = [
            Part(
                "comparing effects with each other", Alike, {"part": "alike", "version": TRIALS_VERSION}, 0.5
            ),
            Part("trials with nothing put in", Tried, {"part": "nothing", **common}, self.trials),
        ]
        for name, where in self._targets():
            on = "" if where is None else f" on {', '.join(where)}"
            for size in sorted(set(self.sizes_deg)):
                facts = {"effect": name, "rotations": where, "size_deg": size, **common}
                pieces.append(Part(f"{name}{on} of {size:g} degrees", Tried, facts, self.trials))
        if len(pieces) * self.trials > MOST_DIAGNOSES:
            raise BadInput(
                f"{len(pieces) * self.trials} diagnoses are too many; name fewer effects, rotations or sizes"
            )
        return pieces

    def run(self, piece: Part, cancelled: Cancel | None, report: Report | None) -> Alike | Tried:
        session, facts = self._session, piece.facts
        if piece.gives is Alike:
            size = np.sqrt(np.nanmean(np.concatenate(session.residual) ** 2, axis=0))
            return Alike(
                confusability(session.problem, declared=session.on.own),
                dict(zip(session.rotations, map(float, size), strict=True)),
            )
        put_in = self._effect(facts["effect"]) if "effect" in facts else None
        where = where_injected(session, put_in, facts.get("rotations"))
        why = None if put_in is None else why_not_injected(session, put_in)
        found = []
        for number in range(self.trials if why is None else 0):
            if report is not None:
                report(f"trial {number + 1}", number / self.trials)
            size_deg, seed = facts.get("size_deg", 0.0), self.seed + number
            found.append(trial(session, put_in, where, size_deg, seed=seed, cancelled=cancelled))
        return Tried(where, [item for item in found if item is not None], why)

    def answer(self, pieces: Sequence[Any]) -> Detectable:
        alike, nothing, *tried = pieces
        sizes = sorted(set(self.sizes_deg))
        effects: list[EffectDetectability] = []
        for number, (name, _) in enumerate(self._targets()):
            each = tried[number * len(sizes) : (number + 1) * len(sizes)]
            why = each[0].why_not
            found = [SizeTried.of(size, item.trials, name) for size, item in zip(sizes, each, strict=True)]
            item = EffectDetectability(name, each[0].rotations, () if why else found, why)
            if item not in effects:  # a delay is on all rotations, whichever was asked for
                effects.append(item)
        return Detectable(
            trials=self.trials,
            residual_deg=alike.residual_deg,
            effects=sorted(effects, key=lambda item: item.why_not is not None),
            control=Control.of(nothing.trials),
            confusability=alike.confusability,
        )

    @cached_property
    def _session(self) -> SurrogateSession:
        return SurrogateSession.of(self.on)

    def _targets(self) -> list[tuple[str, Sequence[str] | None]]:
        names = self.effects
        if names is None:
            names = [item.name for item in catalogue().values() if item.comparison is not None]
        for rotation in {name for where in self.places or () for name in where}:
            if rotation not in self.on.layout.rotations:
                meant = did_you_mean(rotation, self.on.layout.rotations)
                raise BadInput(f"no rotation {rotation!r} in this layout; {meant}")
        return [(self._effect(name).name, where) for name in names for where in self.places or (None,)]

    def _effect(self, name: str) -> Effect:
        return next((item for item in self.on.own if item.name == name), None) or effect(name)


def trial(
    session: SurrogateSession,
    effect: Effect | None,
    rotations: Sequence[str],
    size_deg: float,
    *,
    seed: int = 0,
    cancelled: Cancel | None = None,
) -> Trial | None:
    """``effect`` None: nothing is put in. None where these takes cannot hold so much of it.

    The noise depends on the seed alone: the trials of all sizes and effects of a seed have the same. Raises
    BadInput, Cancelled.
    """
    noise, drawn = np.random.default_rng([seed, 1]), np.random.default_rng([seed, 2])
    item = None if effect is None else injected(session, effect, rotations, size_deg, drawn)
    if effect is not None and item is None:
        return None
    found = replace(session.on, takes=injected_takes(session, item, noise)).diagnosed(
        signatures=False,
        judge_residual=False,
        noise_floors={},
        seed=seed,
        limits=session.limits,
        cancelled=cancelled,
    )
    where = session.rotations if item is None or not item.added else tuple(item.added)
    return Trial(_outcome(found, None if effect is None else effect.name, where), found.naming.confidence_set)


def _outcome(found: Diagnosis, effect: str | None, rotations: Sequence[str]) -> Outcome:
    """It counts as found where it is significant on a rotation that it was put in."""
    members = found.naming.confidence_set
    if not members:
        return "not_found"
    item = next((item for item in found.naming.ranked if item.effect == effect), None)
    where = set() if item is None else {item.joints[i] for i in item.significant_joints}
    if effect not in members or not where & set(rotations):
        return "mistaken"
    return "named" if len(members) == 1 else "ambiguous"
