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
from glovecal_models.sampling.guided.labelled_takes import LabelledTake
from glovecal_models.sampling.template.shapes import KnownAngle, merged, shape_angles, touching_angles
from glovecal_models.takes.take import Take


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
