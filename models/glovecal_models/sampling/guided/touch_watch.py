"""Did the tips touch? Asked while a sampling goes on, of what its steps so far have labelled."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from glovecal_models.errors import BadInput
from glovecal_models.hand.skeleton import Skeleton
from glovecal_models.layout import Layout
from glovecal_models.sampling.guided.labelled_takes import FK, LabelledTake, contact_of, labelled_takes
from glovecal_models.sampling.guided.rotation_posterior import first_posteriors
from glovecal_models.sampling.guided.seen_touches import seen_touches
from glovecal_models.sampling.guided.touch_posterior import TouchPosterior
from glovecal_models.sampling.inverse_kinematics.contact import TipChains
from glovecal_models.sampling.inverse_kinematics.touch_check import require_possible
from glovecal_models.sampling.protocol import Protocol, Step
from glovecal_models.sampling.state import GloveReading, SamplingState
from glovecal_models.takes.take import Take


class TouchWatch:
    """A ``TouchCheck`` for one person's hand.

    The frames it learns from are in memory only: after a restart of its process it says nothing until poses
    are taken again, and the touches are judged when the calibration is trained.
    """

    def __init__(self, layout: Layout, skeleton: Skeleton) -> None:
        self._layout = layout
        self._skeleton = skeleton
        self._labelled: dict[str, LabelledTake] = {}

    def learn(self, state: SamplingState, step: Step, readings: Sequence[GloveReading]) -> None:
        if step.kind in FK:
            self._labelled[step.name] = _labelled(state, step, readings)

    def why_not(self, state: SamplingState, step: Step, readings: Sequence[GloveReading]) -> str | None:
        """A sentence when these frames cannot be of fingertips that touch, or no hand like this can."""
        finished = state.finished()
        known = [
            labelled.in_order(self._layout)
            for name, labelled in self._labelled.items()
            if name in finished and finished[name].outcome == "good"
        ]
        ranges = state.ranges
        if not known or ranges["low"] is None:
            return None
        both = zip(ranges["low"], ranges["high"], strict=True)
        priors = first_posteriors(
            self._layout, labelled_takes(known), dict(zip(state.sensors, both, strict=True))
        )
        first = TouchPosterior(priors, self._layout.sensors, None, ())
        touching = _labelled(state, step, readings).in_order(self._layout)
        _, refused = seen_touches([touching], first, self._skeleton)
        return refused[0].brief if refused else None


def require_possible_touches(protocol: Protocol, skeleton: Skeleton) -> None:
    """Raise BadInput for a touch, or a rod, that no hand of these dimensions can hold."""
    for step in protocol.steps:
        if step.touches:
            contact = contact_of(step.touches, step.rod_mm)
            try:
                require_possible(TipChains(skeleton, contact.fingers), contact, skeleton)
            except BadInput as error:
                raise BadInput(f"step {step.name}: {error}. Protocol fk_only asks for no touch") from error


def _labelled(state: SamplingState, step: Step, readings: Sequence[GloveReading]) -> LabelledTake:
    time_s = np.array([reading.time_s for reading in readings])
    rotations = tuple(step.angles)
    known = np.tile([step.angles[name] for name in rotations], (len(time_s), 1))
    take = Take(
        name=step.name,
        wearing="",
        sensors=state.sensors,
        time_s=time_s,
        readings=np.array([reading.values for reading in readings], float),
        rotations=rotations,
        reference_time_s=time_s if rotations else np.empty(0),
        reference=known if rotations else np.empty((0, 0)),
        poses=(step.pose,) * len(time_s),
    )
    contacts = {step.pose: contact_of(step.touches, step.rod_mm)} if step.touches else {}
    return LabelledTake(take, step.kind, contacts)
