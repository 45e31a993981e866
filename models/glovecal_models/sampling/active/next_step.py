"""Asks for the step that teaches most, again and again, until none is worth its time."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from glovecal_models.errors import BadInput
from glovecal_models.layout import Layout
from glovecal_models.sampling.active.candidates import candidate_steps
from glovecal_models.sampling.active.known_readings import known_from_state
from glovecal_models.sampling.active.proposal import Proposal, ProposedStep, gain_sentence, propose
from glovecal_models.sampling.catalogue import Equipment, steps_for_layout
from glovecal_models.sampling.growing import NextSteps
from glovecal_models.sampling.key_poses import verification_steps
from glovecal_models.sampling.state import SamplingState
from glovecal_models.sampling.step import Step

LONGEST_CAPTURE_S = 240.0
"""Not longer than the fixed protocol, whatever is still to be gained."""
MOST_SKIPPED = 2
"""Steps of one part that were left out: the person has no such widget, or cannot do it."""


class NextStep:
    """Chooses for a sampling from its state and nothing else, so that one state has one answer."""

    def __init__(self, layout: Layout) -> None:
        self._layout = layout

    def __call__(self, state: SamplingState) -> NextSteps:
        equipment = Equipment.from_document(state.protocol.equipment)
        left = still_possible(candidate_steps(self._layout, equipment), state)
        if state.capture_s >= LONGEST_CAPTURE_S:
            return self._ending(f"{state.capture_s:.0f} s of capture are the most that is asked for.")
        try:
            found = propose(self._layout, known_from_state(state), left)
        except (BadInput, np.linalg.LinAlgError) as error:
            return self._ending(f"Nothing can be proposed: {error}")
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
