"""What to record next: in a running sampling, until no step is worth its time, and for a model.

What may be asked: key poses, ramps and blocks at any angle, widgets at any angle. Anything else whose angles
are known is one function, given to ``register_candidates``.

A model's proposals come from its processes, its takes and other readings of the glove. What a diagnosis asks
for stands beside them: such takes separate causes, which no variance of a process can.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.samples import require_layout
from glovecal_models.covariance.functions import SquaredExponentialArd
from glovecal_models.errors import BadInput, reason_of
from glovecal_models.layout import Layout
from glovecal_models.regression.regressor import ProcessRegressor
from glovecal_models.sampling.active.known_readings import known_from_state, known_from_takes
from glovecal_models.sampling.active.proposal import Proposal, ProposedStep, gain_sentence, propose
from glovecal_models.sampling.catalogue import Equipment, steps_for_layout
from glovecal_models.sampling.limits import SAMPLING_LIMITS, SamplingLimits
from glovecal_models.sampling.protocol import (
    HOLD_S,
    WIDGET_DEG,
    Step,
    key_pose_steps,
    verification_steps,
    widget_steps,
)
from glovecal_models.sampling.state import NextSteps, SamplingState
from glovecal_models.takes.take import Take

CANDIDATE_MOVE_S = 2.0
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
    return [replace(step, seconds=CANDIDATE_MOVE_S) for step in steps]


MOST_SKIPPED = 2
"""Steps of one part that were left out: the person has no such widget, or cannot do it."""


class NextStep:
    """Chooses for a sampling from its state and nothing else, so that one state has one answer."""

    def __init__(self, layout: Layout, limits: SamplingLimits = SAMPLING_LIMITS) -> None:
        self._layout, self._limits = layout, limits

    def __call__(self, state: SamplingState) -> NextSteps:
        equipment = Equipment.from_document(state.protocol.equipment)
        left = still_possible(candidate_steps(self._layout, equipment), state)
        if state.capture_s >= self._limits.longest_capture_s:
            return self._ending(f"{state.capture_s:.0f} s of capture are the most that is asked for.")
        try:
            found = propose(self._layout, known_from_state(state), left, limits=self._limits)
        except (BadInput, np.linalg.LinAlgError) as error:
            return self._ending(f"Nothing can be proposed: {reason_of(error)}")
        if found.is_enough:
            return self._ending(found.verdict(), found.to_document(most=0))
        best = found.ranked[0]
        return NextSteps(
            (_named_anew(best.step, state),), False, gain_sentence(best, found), told(found, best)
        )

    def _ending(self, sentence: str, document: dict[str, Any] | None = None) -> NextSteps:
        last = tuple(steps_for_layout(verification_steps("end"), self._layout))
        return NextSteps(last, True, sentence, document or {"sentences": [sentence]})


def told(found: Proposal, best: ProposedStep) -> dict[str, Any]:
    return found.to_document(most=3) | {"step": best.step.name}


def still_possible(candidates: list[Step], state: SamplingState) -> list[Step]:
    """Without what this person left out, and without widgets that were recorded: a widget that is not quite
    at its angle is as far off the next time, another angle is not."""
    finished = [(state.protocol.step(name), each.outcome) for name, each in state.finished().items()]
    skipped = [step for step, outcome in finished if outcome == "skipped"]
    done = [step for step, outcome in finished if outcome == "good" and step.motion == "move"]
    parts = [step.part for step in skipped]
    return [
        step
        for step in candidates
        if not any(_same(step, other) for other in (*skipped, *done))
        and parts.count(step.part) < MOST_SKIPPED
    ]


def _same(step: Step, other: Step) -> bool:
    return (step.part, step.pose, dict(step.angles)) == (other.part, other.pose, dict(other.angles))


def _named_anew(step: Step, state: SamplingState) -> Step:
    """Asked for the second time it is ``NAME-2``."""
    names = {each.name for each in state.protocol.steps}
    number = next(n for n in range(1, len(names) + 2) if _numbered(step.name, n) not in names)
    return replace(step, name=_numbered(step.name, number))


def _numbered(name: str, number: int) -> str:
    return name if number == 1 else f"{name}-{number}"


def propose_for_model(
    model: CalibrationModel,
    takes: Sequence[Take],
    more_free: Sequence[Take] = (),
    equipment: Equipment | None = None,
) -> Proposal:
    """``takes``: those it was trained on; ``more_free``: others, whose readings show where it is used.

    Raises LayoutMismatch, BadInput (no pose or widget is known for the layout, or hardly any frames).
    """
    for take in (*takes, *more_free):
        require_layout(take, model.layout)
    known = known_from_takes(takes, model.layout.sensors, more_free)
    trained = {
        item.rotation: item.regressor
        for item in model.rotations
        if isinstance(item.regressor, ProcessRegressor) and _is_usual(item.regressor)
    }
    found = propose(model.layout, known, candidate_steps(model.layout, equipment), trained=trained)
    return replace(found, sentences=tuple(_sentences(found, [*takes, *more_free])))


def _is_usual(regressor: ProcessRegressor) -> bool:
    """Whether the last term of its covariance is the one that bend and lengthscales are read from."""
    return regressor.covariance.parts()[-1].kind == SquaredExponentialArd.kind


def _sentences(found: Proposal, takes: Sequence[Take]) -> list[str]:
    told = []
    assumed = [name for name in found.sd_deg if name not in found.learned]
    if assumed:
        told.append(
            f"Assumed, not learned: how far {', '.join(assumed)} may be from straight "
            "(as in simulated CyberGloves, and wider)."
        )
    wearings = {take.wearing for take in takes}
    if len(wearings) > 1:
        told.append(
            f"These takes are of {len(wearings)} wearings, between which readings shift; "
            "the figures hold for one of them."
        )
    if not any(_has_free_motion(take) for take in takes):
        told.append("No free motion was recorded: the takes' own readings stand for those of everyday use.")
    return told


def _has_free_motion(take: Take) -> bool:
    return not take.rotations or bool(np.isnan(take.reference_at_frames(take.rotations)).all(axis=1).any())
