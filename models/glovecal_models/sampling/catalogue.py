"""The protocols there are: a new subject (both accuracies or one of them), and a second wearing.

In which order poses and widgets are asked, so that a drift of the readings cannot look like posture.

Readings drift with time: warmth, creep, a glove that slips. Asked in a fixed order, angles rise with time,
and nothing tells the one from the other. So the order is drawn at random, and the first step is asked again
at the end: what it reads otherwise then is drift, slip, and how well a person repeats a pose.

Steps of one part stay together, as they are one take: parts are put in random order, and steps in their part.
An order in which a rotation's angles go with time is drawn again (restricted randomisation, Youden 1972).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal, get_args

import numpy as np

from glovecal_models.errors import BadInput
from glovecal_models.layout import Layout
from glovecal_models.names import did_you_mean
from glovecal_models.sampling.protocol import (
    KEY_POSES,
    WIDEST_DEG,
    Kind,
    PoseAngles,
    Protocol,
    Step,
    WidgetAngles,
    check_steps,
    key_pose_steps,
    rod_step,
    shape_steps,
    touch_steps,
    verification_steps,
    widget_steps,
)

Order = Literal["random", "fixed"]
ORDERS: tuple[Order, ...] = get_args(Order)
SHUFFLED: tuple[Kind, ...] = ("fk_independent", "fk_cross_couple")
REPEAT_PART = "repeat"
MOST_CORRELATED = 0.5
"""Rank correlation of a rotation's angles with their order; three angles have none smaller but 0.5."""
MOST_DRAWS = 200
ProtocolName = Literal["new_subject", "fk_only", "ik_only", "second_wearing", "active", "five_shapes"]
PROTOCOLS: tuple[ProtocolName, ...] = get_args(ProtocolName)
POSE_ROUNDS = 2
SHAPE_ROUNDS = 3
ROD_MM = 60.0
SHORTEST_MM, LONGEST_MM = 5.0, 200.0


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


@dataclass(frozen=True)
class Equipment:
    """What a user has, and has measured, that differs from the usual."""

    widget_deg: WidgetAngles = field(default_factory=dict)
    """Widgets by the rotation they hold; an empty list leaves the rotation out."""
    pose_deg: PoseAngles = field(default_factory=dict)
    """Measured angles by pose."""
    rod_mm: tuple[float, ...] = (ROD_MM,)

    def to_document(self) -> dict[str, Any]:
        return {
            "widget_deg": {name: list(angles) for name, angles in self.widget_deg.items()},
            "pose_deg": {name: dict(angles) for name, angles in self.pose_deg.items()},
            "rod_mm": list(self.rod_mm),
        }

    @classmethod
    def from_document(cls, document: Mapping[str, Any]) -> Equipment:
        """Inverse of ``to_document``; an empty document is the usual equipment."""
        return cls(**({**document, "rod_mm": tuple(document["rod_mm"])} if document else {}))


def make_protocol(
    name: str, layout: Layout, equipment: Equipment | None = None, *, seed: int | None = None
) -> Protocol:
    """One of ``PROTOCOLS``, without what the layout has no sensor or rotation for.

    ``seed``: poses and widgets in random order, the first again at the end (``catalogue.py``); None: in the
    paper's order.

    ``five_shapes`` is the calibration take of Krnoul et al. 2016 (section 3.3.4), always in its own order;
    ``fk_only`` and ``ik_only`` are the paper's accuracy adaptation (section 8.2); ``active`` begins with free
    motion and grows (``active_sampling``). Raises BadInput.
    """
    protocol = _in_fixed_order(name, layout, equipment or Equipment())
    return protocol if seed is None or name == "five_shapes" else in_random_order(protocol, seed)


def method_for(name: str) -> str:
    """The method of calibration that learns from the takes of one of ``PROTOCOLS``."""
    return "template" if name == "five_shapes" else "lmc_gpr"


def _in_fixed_order(name: str, layout: Layout, own: Equipment) -> Protocol:
    _check(own)
    if name == "active":
        first = [_loosen(6.0), *verification_steps("start")]
        return Protocol(name, tuple(steps_for_layout(first, layout)), True, own.to_document())
    independent = [*key_pose_steps(POSE_ROUNDS, own.pose_deg), *widget_steps(layout, own.widget_deg)]
    touching = [*touch_steps(), *(rod_step(length) for length in own.rod_mm)]
    steps: dict[str, list[Step]] = {
        "new_subject": [*independent, *touching],
        "fk_only": independent,
        "ik_only": touching,
    }
    if name == "five_shapes":
        shapes = [_loosen(6.0), *shape_steps(SHAPE_ROUNDS, own.pose_deg)]
        return Protocol(name, tuple(steps_for_layout(shapes, layout)))
    if name == "second_wearing":
        return Protocol(name, tuple(steps_for_layout([_loosen(3.0), *check_steps(KEY_POSES)], layout)))
    if name not in steps:
        raise BadInput(f"no protocol {name!r}; {did_you_mean(name, PROTOCOLS)}")
    asked = steps_for_layout(steps[name], layout)
    around = (
        steps_for_layout([_loosen(6.0), *verification_steps("start")], layout),
        steps_for_layout(verification_steps("end"), layout),
    )
    return Protocol(name, (*around[0], *asked, *around[1]) if asked else ())


def _loosen(seconds: float) -> Step:
    ask = "Open and close the hand, spread the fingers, turn thumb and wrist as far as they go."
    return Step("loosen", "range", "move", ask, seconds, "loosen")


def steps_for_layout(steps: list[Step], layout: Layout) -> list[Step]:
    """Those that can teach the layout something, without sensors and rotations that it has not."""
    fitting = [
        replace(
            step,
            angles={name: angle for name, angle in step.angles.items() if name in layout.rotations},
            moves=tuple(sensor for sensor in step.moves if sensor in layout.sensors),
        )
        for step in steps
    ]
    return [step for step, asked in zip(fitting, steps, strict=True) if _can_teach(step, asked, layout)]


def _can_teach(step: Step, asked: Step, layout: Layout) -> bool:
    if step.touches:
        return all(any(name.startswith(f"{digit}_") for name in layout.sensors) for digit in step.touches)
    return bool(step.angles) or not asked.angles


def _check(own: Equipment) -> None:
    for rotation, angles in own.widget_deg.items():
        if any(not abs(angle) <= WIDEST_DEG for angle in angles) or len(set(angles)) < len(angles):
            told = ", ".join(f"{angle:g}" for angle in angles)
            raise BadInput(
                f"widgets of {rotation}: {told}; give different angles up to {WIDEST_DEG:g} degrees"
            )
    for pose, angles in own.pose_deg.items():
        for rotation, angle in angles.items():
            if not abs(angle) <= WIDEST_DEG:
                raise BadInput(
                    f"pose {pose}: {rotation} is {angle:g} degrees; up to {WIDEST_DEG:g} are possible"
                )
    for length in own.rod_mm:
        if not SHORTEST_MM <= length <= LONGEST_MM:
            raise BadInput(
                f"rod of {length:g} mm: between {SHORTEST_MM:g} and {LONGEST_MM:g} mm can be held so"
            )
