"""Which physical effect is missing: from takes to a name, a set, or silence with a reason."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from glovecal_models.diagnosis.assessment import Assessment
from glovecal_models.diagnosis.candidates import BLOCK_ROWS, NotJudgeable, assessed
from glovecal_models.diagnosis.delay_verdict import MIDDLE, SHAPE_SMOOTHING, delay_kind
from glovecal_models.diagnosis.delays import SMOOTHING, delay_errors
from glovecal_models.diagnosis.diagnosis_document import document
from glovecal_models.diagnosis.directions import Direction, forward
from glovecal_models.diagnosis.evened import EvenTake, evened, shifted, smoothed
from glovecal_models.diagnosis.known_effect import KnownEffect
from glovecal_models.diagnosis.naming import Naming, named
from glovecal_models.diagnosis.next_take import NextTake, next_take
from glovecal_models.diagnosis.reference_problems import reference_problems
from glovecal_models.diagnosis.signatures import (
    AFTER_ALL,
    jump_beside_curve,
    may_be_slip,
    signature_findings,
)
from glovecal_models.diagnosis.something_left import NOT_TOLD, Left, something_left
from glovecal_models.effects.catalogue import catalogue, effect
from glovecal_models.effects.context_dependence import ContextDependence, unfamiliar_columns
from glovecal_models.effects.effect import Effect
from glovecal_models.effects.signature_effect import Finding
from glovecal_models.errors import BadInput, Cancelled
from glovecal_models.layout import Layout
from glovecal_models.takes.take import Take

DELAYS = ("lag", "clock_offset")


@dataclass(frozen=True)
class Diagnosis:
    """Ranked evidence for effects that a model does not know yet."""

    joints: tuple[str, ...]
    rmse_deg: dict[str, float]
    """Held-out error of each joint without any further effect, on smoothed signals."""
    noise_floor_deg: dict[str, float]
    naming: Naming
    assessments: tuple[Assessment, ...]
    """Every effect that could be judged."""
    not_judgeable: tuple[NotJudgeable, ...]
    reference_problems: tuple[str, ...]
    findings: tuple[Finding, ...]
    """What is known by a signature in the recording."""
    left: Left
    next_take: NextTake | None

    @property
    def signature(self) -> tuple[Finding, ...]:
        """Findings of the effect that is to be named by its signature, before any ranking; mostly none."""
        for name in ("repeated_samples", "sensor_fault"):
            found = tuple(item for item in self.findings if item.effect == name)
            if found and name not in self.naming.confidence_set:
                return found
        if self.naming.ranked:
            slips = tuple(item for item in self.findings if item.effect in AFTER_ALL)
            return slips if may_be_slip(self.naming) else ()
        return tuple(item for item in self.findings if item.effect == self.findings[0].effect)

    @property
    def by_gain(self) -> list[Assessment]:
        """All assessments, those that pass first, then by how much they save."""
        return sorted(
            self.assessments,
            key=lambda item: (not item.touched, -item.saved_square, -max(e.contrast for e in item.errors)),
        )

    def to_document(self) -> dict[str, Any]:
        """Plain JSON-able data with sentences."""
        return document(self)


def diagnose(
    takes: Sequence[Take],
    layout: Layout,
    *,
    linear: bool = False,
    known: Sequence[KnownEffect] = (),
    effects: Sequence[Effect] | None = None,
    signatures: bool = True,
    noise_floor_deg: Mapping[str, float] | None = None,
    seed: int = 0,
    cancelled: Callable[[], bool] | None = None,
    report: Callable[[str, float], None] | None = None,
) -> Diagnosis:
    """``known``: effects the model has already; they are part of the base. Raises BadInput, Cancelled."""
    joints = measured_joints(takes, layout)
    if not joints:
        raise BadInput("no take measured a rotation of this layout; a diagnosis needs r.ROTATION columns")

    def said(text: str, share: float) -> None:
        if cancelled and cancelled():
            raise Cancelled("the diagnosis was cancelled")
        if report:
            report(text, share)

    said("looking at the reference", 0.0)
    problems = reference_problems(takes, layout)
    even = [evened(take, layout.sensors, joints) for take in takes]
    direction = _direction(even, SMOOTHING, layout, joints, linear, known)
    has = {item.effect.name for item in known}
    if has & set(DELAYS):
        has |= set(DELAYS)  # what is left of one looks like the other; a shifted reference would hide a delay
    candidates = _candidates(direction, effects)
    sparse = all(take.is_sparse for take in even)
    lasting = [item for item in candidates if sparse and (item.has_memory or item.name in DELAYS)]
    candidates = [item for item in candidates if item not in lasting]
    found, impossible = assessed(direction, candidates, np.random.default_rng(seed), has, said)
    impossible += [NotJudgeable(item.name, "the frames are single poses, too far apart") for item in lasting]
    naming = _delay_told(named(found), even, direction, layout, joints, linear, known)
    findings = tuple(signature_findings(takes, layout, joints, naming, has)) if signatures else ()
    naming = jump_beside_curve(naming, takes, findings)
    errors = {
        name: float(np.sqrt(products.error.sum() / max(products.count.sum(), 1)))
        for name, products in zip(joints, direction.products, strict=True)
    }
    floors = {name: float(value) for name, value in (noise_floor_deg or {}).items()}
    left = (
        NOT_TOLD
        if sparse
        else something_left(_with_first(naming, even, direction, layout, joints, linear, known), seed)
    )
    said("done", 1.0)
    following = next_take(naming.confidence_set)
    return Diagnosis(
        tuple(joints),
        errors,
        floors,
        naming,
        tuple(found),
        tuple(impossible),
        problems,
        findings,
        left,
        following,
    )


def _candidates(direction: Direction, effects: Sequence[Effect] | None) -> list[Effect]:
    """The catalogue, and a curve of each context column that nothing in it asks for."""
    if effects is not None:
        return list(effects)
    known = list(catalogue().values())
    familiar = {name for item in known for name in item.context}
    unfamiliar = unfamiliar_columns(direction.signals, sorted(familiar))
    return [*known, *(ContextDependence.of(name, direction.signals) for name in unfamiliar)]


def _with_first(
    naming: Naming,
    even: Sequence[EvenTake],
    direction: Direction,
    layout: Layout,
    joints: Sequence[str],
    linear: bool,
    known: Sequence[KnownEffect],
) -> Direction:
    """The direction with the first of the ranking in its base: what is left after it."""
    if not naming.ranked:
        return direction
    first = naming.ranked[0]
    if first.effect == "clock_offset":
        delay = np.broadcast_to(first.shapes[0], (len(even),))
        moved = [shifted(take, float(by)) for take, by in zip(even, delay, strict=True)]
        return _direction(moved, SMOOTHING, layout, joints, linear, known)
    where = tuple(first.joints[i] for i in first.touched)
    added = KnownEffect(effect(first.effect), where, tuple(first.shapes[i] for i in first.touched))
    return _direction(even, SMOOTHING, layout, joints, linear, (*known, added))


def measured_joints(takes: Sequence[Take], layout: Layout) -> tuple[str, ...]:
    """Rotations of the layout that some take measured, and that move."""
    return tuple(
        name
        for name in layout.rotations
        if any(
            name in take.rotations and np.isfinite(take.reference[:, take.rotations.index(name)]).sum() > 1
            for take in takes
        )
    )


def _direction(
    even: Sequence[EvenTake],
    smoothing: int,
    layout: Layout,
    joints: Sequence[str],
    linear: bool,
    known: Sequence[KnownEffect],
) -> Direction:
    return forward([smoothed(take, smoothing) for take in even], layout, joints, linear=linear, known=known)


def _delay_told(
    naming: Naming,
    even: Sequence[EvenTake],
    direction: Direction,
    layout: Layout,
    joints: Sequence[str],
    linear: bool,
    known: Sequence[KnownEffect],
) -> Naming:
    """Put the delays that lead a ranking in the right order."""
    if not naming.ranked or naming.ranked[0].effect not in DELAYS:
        return naming
    strong = _direction(even, SHAPE_SMOOTHING, layout, joints, linear, known)
    kind, score = delay_kind(delay_errors(direction, BLOCK_ROWS), delay_errors(strong, BLOCK_ROWS))
    first = kind if kind != "either" else "lag" if score > MIDDLE else "clock_offset"
    delays = [item for item in naming.ranked if item.effect in DELAYS]
    if first not in {item.effect for item in delays}:
        return naming
    delays.sort(key=lambda item: item.effect != first)
    others = [item for item in naming.ranked if item.effect not in DELAYS]
    kept = [name for name in naming.confidence_set if name not in DELAYS]
    told = DELAYS if kind == "either" else (first,)
    return replace(
        naming,
        ranked=(*delays, *others),
        confidence_set=(first, *(name for name in told if name != first), *kept),
    )
