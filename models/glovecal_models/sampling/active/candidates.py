"""What may be asked next: key poses, ramps and blocks at any angle, widgets at any angle.

Anything else whose angles are known is one function, given to ``register_candidates``.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from glovecal_models.layout import Layout
from glovecal_models.sampling.catalogue import Equipment, steps_for_layout
from glovecal_models.sampling.key_poses import HOLD_S, key_pose_steps
from glovecal_models.sampling.protocol import Step
from glovecal_models.sampling.widgets import WIDGET_DEG, widget_steps

MOVE_S = 2.0
"""Shorter than the fixed protocol's 4 s: another angle tells more than more of the same."""
WIDGET_LEVELS = 7
RAMP_DEG = (20.0, 45.0, 70.0)
BLOCK_DEG = (30.0, 60.0)

MakeCandidates = Callable[[Layout, Equipment], list[Step]]
_makers: list[MakeCandidates] = []


def register_candidates(make: MakeCandidates) -> Callable[[], None]:
    """Further steps for every proposal from now on, until the answer is called.

    Each step names the rotations whose angles it knows.
    """
    _makers.append(make)
    return lambda: _makers.remove(make)


def candidate_steps(layout: Layout, equipment: Equipment | None = None) -> list[Step]:
    """Steps that this layout could learn from, each with a name of its own.

    Widgets and poses that ``equipment`` lists go before the usual ones, as in the fixed protocols.
    """
    own = equipment or Equipment()
    steps = [*_poses(own), *_held_fingers(), *_widgets(layout, own)]
    for make in _makers:
        steps += make(layout, own)
    return list({step.name: step for step in steps_for_layout(steps, layout)}.values())


def _poses(own: Equipment) -> list[Step]:
    """Each key pose once; the ramps are made below."""
    steps = [replace(step, name=step.pose) for step in key_pose_steps(1, own.pose_deg)]
    return [step for step in steps if step.pose != "ramp" or "ramp" in own.pose_deg]


def _held_fingers() -> list[Step]:
    ramps = [
        _hold(
            f"ramp-{deg:g}",
            f"Palm on the table, straight fingers down the {deg:g} degree ramp.",
            f"the {deg:g} degree ramp",
            {f"{finger}_MCP": deg for finger in "IMRP"} | {f"{finger}_PIP": 0.0 for finger in "IMRP"},
        )
        for deg in RAMP_DEG
    ]
    blocks = [
        _hold(
            f"block-{deg:g}",
            f"Palm and knuckles flat, the fingers bent over the {deg:g} degree block at their middle joints.",
            f"the {deg:g} degree block",
            {f"{finger}_MCP": 0.0 for finger in "IMRP"} | {f"{finger}_PIP": deg for finger in "IMRP"},
        )
        for deg in BLOCK_DEG
    ]
    return [*ramps, *blocks]


def _hold(name: str, ask: str, needs: str, angles: dict[str, float]) -> Step:
    part = name.partition("-")[0]
    return Step(name, "fk_independent", "hold", ask, HOLD_S, part, pose=name, angles=angles, needs=needs)


def _widgets(layout: Layout, own: Equipment) -> list[Step]:
    between = {
        rotation: tuple(np.linspace(min(angles), max(angles), WIDGET_LEVELS).round().tolist())
        for rotation, angles in WIDGET_DEG.items()
    }
    steps = widget_steps(layout, {**between, **own.widget_deg})
    return [replace(step, seconds=MOVE_S) for step in steps]
