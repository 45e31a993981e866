"""Which physical effect is missing: from takes to a name, a set, or silence with a reason."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from glovecal_models.diagnosis.candidates import NotJudgeable, assessed
from glovecal_models.diagnosis.delays_told import DELAYS, delays_told
from glovecal_models.diagnosis.diagnosis import Diagnosis
from glovecal_models.diagnosis.directions import Direction
from glovecal_models.diagnosis.ground import Ground
from glovecal_models.diagnosis.hold_drift import hold_drift
from glovecal_models.diagnosis.hold_drift_document import hold_next_take
from glovecal_models.diagnosis.known_effect import KnownEffect
from glovecal_models.diagnosis.naming import Naming, named
from glovecal_models.diagnosis.next_take import next_take
from glovecal_models.diagnosis.pose_labels import WHY_NOT_JUDGEABLE, are_pose_labels
from glovecal_models.diagnosis.reference_problems import reference_problems
from glovecal_models.diagnosis.signatures import are_held_levels, jump_beside_curve, signature_findings
from glovecal_models.diagnosis.something_left import not_told, something_left
from glovecal_models.diagnosis.undecided import as_known, deciding, likelier
from glovecal_models.effects.base.effect import Effect
from glovecal_models.effects.catalogue import catalogue
from glovecal_models.effects.context_dependence import ContextDependence, unfamiliar_columns
from glovecal_models.errors import Cancelled
from glovecal_models.layout import Layout
from glovecal_models.takes.take import Take

SINGLE_POSES = "the frames are single poses; record the movement from one to the next"


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

    def said(text: str, share: float) -> None:
        if cancelled and cancelled():
            raise Cancelled("the diagnosis was cancelled")
        if report:
            report(text, share)

    said("looking at the reference", 0.0)
    ground = Ground.of(takes, layout, linear, known)
    problems = reference_problems(takes, layout)
    direction = ground.direction()
    candidates = _candidates(direction, effects)
    if are_pose_labels(takes):
        return _of_pose_labels(takes, layout, direction, candidates, problems, seed)
    lasting = [item for item in candidates if ground.is_sparse and (item.has_memory or item.name in DELAYS)]
    candidates = [item for item in candidates if item not in lasting]
    has = _has(known)
    found, impossible = assessed(direction, candidates, np.random.default_rng(seed), has, said)
    naming, screened, beside = named(found), direction, ground
    undecided = likelier(impossible, naming)
    if undecided:
        # What may well be there is not to get another's name: the others are judged beside it.
        beside = ground.beside(*(as_known(item, candidates) for item in undecided))
        others = [item for item in candidates if item.name not in {each.effect for each in impossible}]
        screened = beside.direction()
        found, _ = assessed(screened, others, np.random.default_rng(seed), has, said)
        naming = named(found)
    impossible += [NotJudgeable(item.name, SINGLE_POSES) for item in lasting]
    naming = delays_told(naming, beside, screened)
    asked = signature_findings(takes, layout, ground.joints, naming, found, has)
    findings = tuple(asked) if signatures else ()
    naming = jump_beside_curve(naming, takes, findings)
    said("looking at what is left", 0.95)
    if ground.is_sparse or are_held_levels(takes):
        left = not_told(SINGLE_POSES)
    else:
        rest = ground.with_first(naming).direction()
        may_be = [item.effect for item in impossible if item.saves_much]
        left = something_left(rest, ground.even, layout, seed, may_be=may_be)
    said("done", 1.0)
    return Diagnosis(
        ground.joints,
        _held_out_errors(direction),
        {name: float(value) for name, value in (noise_floor_deg or {}).items()},
        naming,
        tuple(found),
        tuple(impossible),
        problems,
        findings,
        left,
        next_take(naming.confidence_set) or deciding(impossible, left),
    )


def _has(known: Sequence[KnownEffect]) -> set[str]:
    """What is left of one delay looks like the other, and a shifted reference would hide it."""
    names = {item.effect.name for item in known}
    return names | set(DELAYS) if names & set(DELAYS) else names


def _candidates(direction: Direction, effects: Sequence[Effect] | None) -> list[Effect]:
    """The catalogue, and a curve of each context column that nothing in it asks for."""
    if effects is not None:
        return list(effects)
    known = list(catalogue().values())
    familiar = {name for item in known for name in item.context}
    unfamiliar = unfamiliar_columns(direction.signals, sorted(familiar))
    return [*known, *(ContextDependence.of(name, direction.signals) for name in unfamiliar)]


def _held_out_errors(direction: Direction) -> dict[str, float]:
    return {
        name: float(np.sqrt(products.error.sum() / max(products.count.sum(), 1)))
        for name, products in zip(direction.rotations, direction.products, strict=True)
    }


def _of_pose_labels(
    takes: Sequence[Take],
    layout: Layout,
    direction: Direction,
    candidates: Sequence[Effect],
    problems: tuple[str, ...],
    seed: int,
) -> Diagnosis:
    """No effect can be judged by the names of poses; what readings do while one is held can."""
    drift = hold_drift(takes, layout.sensors, seed=seed)
    return Diagnosis(
        direction.rotations,
        _held_out_errors(direction),
        {},
        Naming((), ()),
        (),
        tuple(NotJudgeable(item.name, WHY_NOT_JUDGEABLE) for item in candidates if item.name != "no_effect"),
        problems,
        (),
        not_told("no angle was measured"),
        hold_next_take(drift),
        drift,
    )
