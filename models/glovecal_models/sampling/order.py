"""In which order poses and widgets are asked, so that a drift of the readings cannot look like posture.

Readings drift with time: warmth, creep, a glove that slips. Asked in a fixed order, angles rise with time,
and nothing tells the one from the other. So the order is drawn at random, and the first step is asked again
at the end: what it reads otherwise then is drift, slip, and how well a person repeats a pose.

Steps of one part stay together, as they are one take: parts are put in random order, and steps in their part.
An order in which a rotation's angles go with time is drawn again (restricted randomisation, Youden 1972).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal, get_args

import numpy as np

from glovecal_models.sampling.protocol import Kind, Protocol, Step

Order = Literal["random", "fixed"]
ORDERS: tuple[Order, ...] = get_args(Order)
SHUFFLED: tuple[Kind, ...] = ("fk_independent", "fk_cross_couple")
REPEAT_PART = "repeat"
MOST_CORRELATED = 0.5
"""Rank correlation of a rotation's angles with their order; three angles have none smaller but 0.5."""
MOST_DRAWS = 200


def in_random_order(protocol: Protocol, seed: int) -> Protocol:
    """Poses and widgets in the random order of ``seed``, the first of them again at the end.

    Other steps, such as touches, which need the poses before them, stay where they are. A protocol that
    grows chooses its own order and stays as it is.
    """
    if protocol.grows:
        return protocol
    random = np.random.default_rng(seed)
    chosen = [step for step in protocol.steps if step.kind in SHUFFLED]
    if not chosen:
        return protocol
    parts = list(dict.fromkeys(step.part for step in chosen))
    shuffled: list[Step] = []
    for at in random.permutation(len(parts)).tolist():
        shuffled += _drawn([step for step in chosen if step.part == parts[at]], random)
    following = iter(shuffled)
    steps = [next(following) if step.kind in SHUFFLED else step for step in protocol.steps]
    return replace(protocol, steps=(*steps, again(shuffled[0])), seed=seed)


def again(step: Step) -> Step:
    """The same once more, to be held against the first time, as a verification; a widget teaches nothing."""
    return replace(step, name=f"{step.name}-again", kind="verification", part=REPEAT_PART, repeats=step.name)


def _drawn(steps: Sequence[Step], random: np.random.Generator) -> list[Step]:
    """``steps`` in a random order; the least correlated one seen if all go with time."""
    best: list[Step] = list(steps)
    least = np.inf
    for _ in range(MOST_DRAWS):
        drawn = [steps[at] for at in random.permutation(len(steps)).tolist()]
        worst = _worst_correlation(drawn)
        if worst < least:
            best, least = drawn, worst
        if least <= MOST_CORRELATED + 1e-9:
            break
    return best


def _worst_correlation(steps: Sequence[Step]) -> float:
    """The largest rank correlation of an angle with its place, over rotations with three angles or more."""
    worst = 0.0
    for rotation in {name for step in steps for name in step.angles}:
        known = [
            (place, step.angles[rotation]) for place, step in enumerate(steps) if rotation in step.angles
        ]
        angles = np.array([angle for _, angle in known])
        if len(set(angles.tolist())) > 2:
            places = np.array([place for place, _ in known])
            worst = max(worst, abs(float(np.corrcoef(_ranks(angles), _ranks(places))[0, 1])))
    return worst


def _ranks(values: np.ndarray) -> np.ndarray:
    """Equal values share their mean rank."""
    below, upto = (values[:, None] > values).sum(axis=1), (values[:, None] >= values).sum(axis=1)
    return (below + upto) / 2
