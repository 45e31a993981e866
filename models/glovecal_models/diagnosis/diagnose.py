"""Which physical effect is missing: from takes to a name, a set, or silence with a reason."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from glovecal_models.diagnosis.assessment import Assessment
from glovecal_models.diagnosis.candidates import BLOCK_ROWS, NotJudgeable, assessed
from glovecal_models.diagnosis.delay_verdict import MIDDLE, SHAPE_SMOOTHING, delay_kind
from glovecal_models.diagnosis.delays import SMOOTHING, delay_errors
from glovecal_models.diagnosis.directions import Direction, forward
from glovecal_models.diagnosis.evened import EvenTake, evened, smoothed
from glovecal_models.diagnosis.known_effect import KnownEffect
from glovecal_models.diagnosis.naming import Naming, named
from glovecal_models.effects.catalogue import catalogue
from glovecal_models.effects.effect import Effect
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
    naming: Naming
    assessments: tuple[Assessment, ...]
    """Every effect that could be judged."""
    not_judgeable: tuple[NotJudgeable, ...]


def diagnose(
    takes: Sequence[Take],
    layout: Layout,
    *,
    linear: bool = False,
    known: Sequence[KnownEffect] = (),
    effects: Sequence[Effect] | None = None,
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

    said("evening out the takes", 0.0)
    even = [evened(take, layout.sensors, joints) for take in takes]
    direction = _direction(even, SMOOTHING, layout, joints, linear, known)
    generator = np.random.default_rng(seed)
    candidates = list((catalogue() if effects is None else {e.name: e for e in effects}).values())
    found, impossible = assessed(direction, candidates, generator, said)
    naming = _delay_told(named(found), even, direction, layout, joints, linear, known)
    errors = {
        name: float(np.sqrt(products.error.sum() / max(products.count.sum(), 1)))
        for name, products in zip(joints, direction.products, strict=True)
    }
    said("done", 1.0)
    return Diagnosis(tuple(joints), errors, naming, tuple(found), tuple(impossible))


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
