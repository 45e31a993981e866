"""From the takes of a sampling to what a template is trained on, by the same training as every other model.

The equations are found first (``initialisation.py``); the takes that are trained on have the angles which
these give to their frames. Least squares of the training then find the very same scales and offsets, and the
model is stored, served and compared like any other. What it claims to err by is what the shapes left open.

Takes of named hand shapes with the angles that the names tell, for the glove maker's calibration.

A flat hand has the angles of a usual flat hand; where fingertips touch, thumb and finger have those of the
likeliest resting hand that keeps the touch. Fingers that the touch does not need may be anywhere: their
rotations stay without a second angle.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from glovecal_models.calibration.model import CalibrationModel, RotationModel
from glovecal_models.calibration.samples import require_layout
from glovecal_models.calibration.training import train, uncertain_above
from glovecal_models.calibration.training_settings import TrainingSettings
from glovecal_models.hand.rotations import PALM
from glovecal_models.hand.skeleton import Skeleton, hand_skeleton
from glovecal_models.layout import Layout
from glovecal_models.regression.linear_regressor import LinearRegressor
from glovecal_models.sampling.guided.labelled_takes import LabelledTake, contact_of
from glovecal_models.sampling.protocol import usual_angles
from glovecal_models.sampling.shown_hands import (
    KnownAngle,
    Observation,
    merged,
    observations,
    shape_angles,
    touching_angles,
)
from glovecal_models.sampling.template.initialisation import Initialisation, initialised
from glovecal_models.takes.still_hand import stillest
from glovecal_models.takes.take import Take

HOW = "not estimated: hand shapes whose angles nobody measured"
POSES = {"flat": "flat", "spread": "spread", "fist": "fist", "o-index": "touch-I", "o-pinky": "touch-P"}
"""Of the shapes of a session, whose takes have their names."""


@dataclass(frozen=True)
class TemplateSamples:
    """Ready for training by method ``template``."""

    takes: tuple[Take, ...]
    layout: Layout
    initialisation: Initialisation
    seen: tuple[Observation, ...]
    is_assumed_hand: bool

    @property
    def sentences(self) -> tuple[str, ...]:
        left = self.initialisation.contact_mm
        shapes = len([each for each in self.seen if each.pose])
        told = ", ".join(self.initialisation.equations.rotations)
        said = [f"{shapes} hand shapes tell scale and offset of {told}."]
        if left:
            each = ", ".join(f"{pose} {distance:.1f}" for pose, distance in left.items())
            said.append(f"Distance of the tips that the template leaves (mm, median): {each}.")
        else:
            said.append("No shape with fingertips together: the thumb's place is that of a usual hand.")
        if left and self.is_assumed_hand:
            said.append("Nobody measured the hand: its proportions are those of a usual one.")
        return tuple(said)

    def finished(self, model: CalibrationModel) -> CalibrationModel:
        """``model``, trained on ``takes``, claiming what the shapes left open."""
        model = replace(model, rotations=tuple(self._claiming(item) for item in model.rotations))
        if "rmse_deg" in model.error_estimate:
            return model
        return replace(model, error_estimate={"how": HOW, "folds": 0})

    def _claiming(self, item: RotationModel) -> RotationModel:
        if not isinstance(item.regressor, LinearRegressor):
            return item  # a rule has the noise of what it follows
        readings = np.concatenate([each.readings for each in self.seen])
        variance = float(self.initialisation.variance(item.rotation, readings).mean())
        regressor = replace(item.regressor, noise_variance=variance)
        return replace(item, regressor=regressor, uncertain_above_deg=uncertain_above(variance))


def template_samples(
    takes: Sequence[LabelledTake], layout: Layout, skeleton: Skeleton | None, *, palm: bool = True
) -> TemplateSamples:
    """Of held shapes, widgets and touches. Without a ``skeleton`` touches are those of an assumed hand.

    ``palm``: whether the palm flex sensor turns the little finger's metacarpal (equations 2, 3 and 5), in
    which case the hand that touches is one whose palm arches. Raises NotTrainable, LayoutMismatch.
    """
    for labelled in takes:
        require_layout(labelled.take, layout)
    used = [labelled.in_order(layout) for labelled in takes]
    arching = palm and PALM in layout.sensors and PALM in layout.rotations
    hand = _hand(skeleton, arching)
    seen = observations(used, hand)
    found = initialised(seen, layout.sensors, hand, palm=arching)
    return TemplateSamples(
        tuple(_with_angles(labelled, found) for labelled in used if _rows(labelled)),
        layout, found, tuple(seen), hand.dimensions.is_assumed,
    )  # fmt: skip


def template_calibration(
    takes: Sequence[LabelledTake],
    layout: Layout,
    subject: str,
    skeleton: Skeleton | None,
    *,
    palm: bool = True,
    take_hashes: Sequence[str] = (),
    parent: str | None = None,
) -> CalibrationModel:
    """The template of one sampling or several, with nobody but the wearer. Raises NotTrainable."""
    samples = template_samples(takes, layout, skeleton, palm=palm)
    settings = TrainingSettings(method="template", folds=0)
    model = train(samples.takes, layout, subject, settings, take_hashes=take_hashes, parent=parent)
    return samples.finished(model)


def _hand(skeleton: Skeleton | None, arching: bool) -> Skeleton:
    palm = "arching" if arching else "rigid"
    if skeleton is None:
        return hand_skeleton(palm=palm)
    return hand_skeleton(skeleton.dimensions, skeleton.hand, palm)


def _rows(labelled: LabelledTake) -> list[int]:
    """Frames that teach: of steps with known angles, of touches, of named shapes."""
    rows: set[int] = set()
    for step in labelled.steps():
        rows |= set(step.tolist())
    for pose in labelled.contacts:
        rows |= set(labelled.frames(pose).tolist())
    return sorted(rows)


def _with_angles(labelled: LabelledTake, found: Initialisation) -> Take:
    take, names, rows = labelled.take, found.equations.rotations, _rows(labelled)
    reference = np.full((len(take.time_s), len(names)), np.nan)
    reference[rows] = _columns(found.angles(name, take.readings[rows]) for name in names)
    return replace(take, rotations=names, reference_time_s=take.time_s, reference=reference)


def _columns(angles: Iterable[np.ndarray]) -> np.ndarray:
    return np.column_stack(list(angles))


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
