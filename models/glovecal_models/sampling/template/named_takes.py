"""Takes of named hand shapes with the angles that the names tell, for the glove maker's calibration.

A flat hand has the angles of a usual flat hand; where fingertips touch, thumb and finger have those of the
likeliest resting hand that keeps the touch. Fingers that the touch does not need may be anywhere: their
rotations stay without a second angle.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from glovecal_models.hand.skeleton import Skeleton, hand_skeleton
from glovecal_models.sampling.guided.labelled_takes import LabelledTake, contact_of
from glovecal_models.sampling.steps import usual_angles
from glovecal_models.sampling.template.shapes import KnownAngle, merged, shape_angles, touching_angles
from glovecal_models.takes.session_drift import stillest
from glovecal_models.takes.take import Take

POSES = {"flat": "flat", "spread": "spread", "fist": "fist", "o-index": "touch-I", "o-pinky": "touch-P"}
"""Of the shapes of a session, whose takes have their names."""


def shape_take(take: Take, shape: str) -> LabelledTake:
    """The stillest second of a take in which one of the session's shapes was held, as a sampling has it."""
    pose, rows = POSES[shape], stillest(take)
    names = ["" for _ in take.time_s]
    names[rows] = [pose] * len(names[rows])
    shown = replace(take, poses=tuple(names))
    if pose.startswith("touch-"):
        return LabelledTake(shown, "ik", {pose: contact_of(("T", pose[-1]), None)})
    angles = usual_angles()[pose]
    reference = np.full((len(take.time_s), len(angles)), np.nan)
    reference[rows] = list(angles.values())
    known = replace(shown, rotations=tuple(angles), reference_time_s=take.time_s, reference=reference)
    return LabelledTake(known, "fk_independent")


def named_takes(takes: Sequence[LabelledTake], skeleton: Skeleton | None) -> list[Take]:
    """Those with a named shape; without a ``skeleton`` touches are those of an assumed hand."""
    hand = hand_skeleton() if skeleton is None else skeleton
    return [found for labelled in takes if (found := _named(labelled, hand)) is not None]


def _named(labelled: LabelledTake, hand: Skeleton) -> Take | None:
    take, known = labelled.take, {}
    for pose in dict.fromkeys(take.poses or ()):
        contact = labelled.contacts.get(pose)
        told = shape_angles(pose) if contact is None else touching_angles(hand, contact)
        if told:
            known[pose] = merged(told)
    names = tuple(dict.fromkeys(name for told in known.values() for name in told))
    if not names:
        return None
    reference = np.full((len(take.time_s), len(names)), np.nan)
    for pose, told in known.items():
        reference[labelled.frames(pose)] = _row(names, told)
    return replace(take, rotations=names, reference_time_s=take.time_s, reference=reference)


def _row(names: Sequence[str], told: dict[str, KnownAngle]) -> list[float]:
    return [told[name].degrees if name in told else np.nan for name in names]
