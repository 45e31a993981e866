"""Which touches of a sampling can be believed, and in which frames; others are refused with the reason.

A touch is first looked at by itself, then beside the others: one that the likeliest calibration of the whole
session leaves open cannot be true.

Training takes of the second pass: what was known beforehand and what touches tell, on the same readings.

Every frame gets the angle that the likeliest calibration of the whole session reads there. A widget's own
four angles would teach a process a staircase: readings scatter about each step while the angle does not, and
the likeliest process is flat there. So the noise goes where it does no harm (Berkson 1950): the angle is what
the calibration reads from the frame as it came, the readings are those without the noise. The map keeps its
slope, and the noise that a process learns is that of a live frame.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from glovecal_models.calibration.model import CalibrationModel, RotationModel
from glovecal_models.calibration.training import uncertain_above
from glovecal_models.errors import BadInput
from glovecal_models.hand.rotations import FINGERS, HAND_ROTATIONS
from glovecal_models.hand.skeleton import Skeleton
from glovecal_models.layout import Correspondence, Layout
from glovecal_models.progress import Cancel
from glovecal_models.regression.linear_regressor import LinearRegressor
from glovecal_models.regression.regressor import ProcessRegressor
from glovecal_models.sampling.guided.labelled_takes import LabelledTake
from glovecal_models.sampling.guided.rotation_posterior import RotationPosterior
from glovecal_models.sampling.guided.touch_posterior import TouchFrames, TouchPosterior
from glovecal_models.sampling.inverse_kinematics.contact import Rod, TipChains, Touch
from glovecal_models.sampling.inverse_kinematics.follow import PredictedHand, follow, steadied
from glovecal_models.sampling.inverse_kinematics.touch_check import (
    TouchNotSeen,
    judged,
    require_happened,
    require_possible,
)
from glovecal_models.sampling.limits import SAMPLING_LIMITS, SamplingLimits
from glovecal_models.sampling.protocol import Kind
from glovecal_models.takes.take import Take

LOOKED_AT = 60
"""Frames of each touch that are worked out one by one; their neighbours are alike."""
FRAMES_A_TAKE = 40
"""Frames of a take that stand for all."""
LEAST_TOLD = 0.05
"""Of what was not known of a joint; a touch that tells less only repeats the calibration."""


@dataclass(frozen=True)
class SeenTouch:
    """A contact that happened."""

    take: Take
    pose: str
    contact: Touch | Rod
    rotations: tuple[str, ...]
    """That move its tips."""
    rows: np.ndarray
    """Of the take: all frames in which it is believed."""
    readings: np.ndarray
    """(len(rows), S), without the sensors' noise."""
    apart_mm: float
    """How far the first calibration read the tips from where they were (median)."""

    def some(self, most: int) -> TouchFrames:
        """At most about ``most`` frames, evenly in time."""
        return TouchFrames(self.contact, self.readings[:: max(1, -(-len(self.rows) // most))])


@dataclass(frozen=True)
class RefusedTouch:
    take: str
    pose: str
    reason: str
    brief: str
    """The same in few words."""


def seen_touches(
    takes: Iterable[LabelledTake], first: TouchPosterior, skeleton: Skeleton
) -> tuple[list[SeenTouch], list[RefusedTouch]]:
    """Every contact of ``takes`` looked at through ``first``, the calibration without any touch."""
    seen: list[SeenTouch] = []
    refused: list[RefusedTouch] = []
    for labelled in takes:
        for pose, contact in labelled.contacts.items():
            try:
                seen.append(_seen(labelled, pose, contact, first, skeleton))
            except BadInput as error:
                brief = error.brief if isinstance(error, TouchNotSeen) else f"{error}."
                refused.append(RefusedTouch(labelled.take.name, pose, str(error), brief))
    return seen, refused


def _seen(
    labelled: LabelledTake, pose: str, contact: Touch | Rod, first: TouchPosterior, skeleton: Skeleton
) -> SeenTouch:
    chains = TipChains(skeleton, contact.fingers)
    require_possible(chains, contact, skeleton)
    take, rows = labelled.take, labelled.frames(pose)
    if not len(rows):
        raise BadInput(f"no frame of take {take.name!r} is named {pose!r}")
    smooth = steadied(take.time_s[rows], take.readings[rows].astype(float))
    some = np.arange(0, len(rows), max(1, len(rows) // LOOKED_AT))
    hand = _hand(first, smooth[some])
    shape = hand.shape(chains)
    verdict = judged(chains, contact, shape, follow(chains, contact, shape))
    require_happened(verdict, contact, hand, skeleton)
    nearest = np.abs(np.arange(len(rows))[:, None] - some).argmin(axis=1)
    kept = verdict.believable[nearest]
    apart = float(np.median(verdict.apart_mm))
    return SeenTouch(take, pose, contact, chains.rotations, rows[kept], smooth[kept], apart)


def _hand(first: TouchPosterior, readings: np.ndarray) -> PredictedHand:
    """As the priors see it in ``readings`` (N, S)."""
    mean = np.column_stack([first.angles(name, readings) for name in HAND_ROTATIONS])
    variance = np.column_stack([first.variance(name, readings) for name in HAND_ROTATIONS])
    new = np.array([first.priors[name].prior.frame_sd_deg for name in HAND_ROTATIONS])
    return PredictedHand(mean, np.sqrt(variance + new**2), np.zeros(mean.shape, dtype=bool))


FRAMES_A_TOUCH = 100
"""Of each touch that the search for the likeliest calibration looks at."""


def closing_touches(
    priors: Mapping[str, RotationPosterior],
    sensors: Sequence[str],
    skeleton: Skeleton,
    seen: Sequence[SeenTouch],
    cancelled: Cancel | None = None,
    limits: SamplingLimits = SAMPLING_LIMITS,
) -> tuple[TouchPosterior, list[SeenTouch], list[RefusedTouch]]:
    """The likeliest calibration, the touches it rests on, and those that contradict. Raises Cancelled."""
    kept, refused = list(seen), []
    most = limits.touch_most_left_mm
    while True:
        touches = [touch.some(FRAMES_A_TOUCH) for touch in kept]
        posterior = TouchPosterior(priors, sensors, skeleton, touches, cancelled)
        left = [float(np.median(posterior.apart_mm(touch, skeleton))) for touch in touches]
        if not left or max(left) <= most:
            return posterior, kept, refused
        strange = kept.pop(int(np.argmax(left)))
        reason = (
            f"with the other touches and poses {max(left):.0f} mm are left between the tips, at most "
            f"{most:g} are believed. Repeat the motion with the tips together, or check the hand's "
            "dimensions"
        )
        brief = f"{max(left):.0f} mm are left between the tips with the other touches."
        refused.append(RefusedTouch(strange.take.name, strange.pose, reason, brief))


SHOWN = 4


def guided_sentences(
    seen: Sequence[SeenTouch],
    refused: Sequence[RefusedTouch],
    told: Mapping[str, float],
    posterior: TouchPosterior,
    skeleton: Skeleton | None,
) -> list[str]:
    """Of touches: what each closed, what they told most of, and which were refused."""
    said = [_closed(touch, posterior, skeleton) for touch in seen if skeleton is not None]
    if told:
        most = sorted(told, key=lambda name: -told[name])[:SHOWN]
        shares = ", ".join(f"{name} {100 * told[name]:.0f} %" for name in most)
        said.append(f"Of what poses and widgets left open of a joint the touches told most of {shares}.")
    said += [f"Left out: {each.pose} of take {each.take}: {each.reason}." for each in refused]
    return said


def hold_sentence(holds: int, sd_deg: float) -> str:
    return (
        f"{holds} poses were held, {sd_deg:.1f} degrees (standard deviation) from the angles they are said "
        "to have: each counts as one sample of that accuracy, however many frames it has."
    )


def nothing_left(has_skeleton: bool, touches: int, refused: Sequence[RefusedTouch]) -> str:
    """Why there is nothing to train on."""
    if refused:
        reasons = "; ".join(f"{each.pose}: {each.reason}" for each in refused)
        return f"no take has known angles, and every touch was refused ({reasons})"
    if touches and not has_skeleton:
        return "touches need the subject's hand dimensions, and no other take has known angles"
    return "no pose, no widget and no touch among these takes"


def _closed(touch: SeenTouch, posterior: TouchPosterior, skeleton: Skeleton) -> str:
    left = float(np.median(posterior.apart_mm(touch.some(60), skeleton)))
    first, second = (FINGERS[finger] for finger in touch.contact.fingers)
    what = f"{first} and {second} at the rod" if isinstance(touch.contact, Rod) else f"{first} and {second}"
    return (
        f"Tips of {what}: read {touch.apart_mm:.1f} mm off before, {left:.1f} mm with what all touches tell "
        f"(median of {len(touch.rows)} frames)."
    )


@dataclass(frozen=True)
class SampleCount:
    """Of one rotation, from one kind of take."""

    rotation: str
    kind: Kind
    samples: int
    told: float | None = None
    """IK: the share of what was not known before that the touches told, 0 to 1."""


@dataclass(frozen=True)
class LabelledSamples:
    """A take to train on: readings without noise, angles of the likeliest calibration."""

    take: Take
    kind: Kind
    ruled: tuple[str, ...] = ()
    """Rotations that nobody knows here but by rule: they keep a map from going astray between touches."""


def known_samples(
    takes: Iterable[LabelledTake], posterior: TouchPosterior, told: Iterable[str] = ()
) -> list[LabelledSamples]:
    """From takes with known angles. In held poses also joints without a sensor that touches ``told`` of: a
    straight finger is straight, and no touch shows that."""
    ruled = tuple(name for name in told if posterior.priors[name].prior.follows)
    labelled_samples = []
    for labelled in takes:
        if not labelled.take.rotations or labelled.kind not in ("fk_independent", "fk_cross_couple"):
            continue
        take, smooth = labelled.take, steadied(labelled.take.time_s, labelled.take.readings.astype(float))
        reference = _as_read(take, posterior)
        if labelled.kind == "fk_independent" and ruled:
            held = np.asarray(np.isfinite(reference).any(axis=1))
            column = np.full((len(held), len(ruled)), np.nan)
            for index, name in enumerate(ruled):
                column[held, index] = posterior.angles(name, take.readings[held])
            names, reference = (*take.rotations, *ruled), np.hstack([reference, column])
            labelled_samples.append(_labelled_samples(take, smooth, names, reference, labelled.kind, ruled))
            continue
        labelled_samples.append(_labelled_samples(take, smooth, take.rotations, reference, labelled.kind))
    return labelled_samples


def touch_samples(
    seen: Sequence[SeenTouch], posterior: TouchPosterior, rotations: Sequence[str]
) -> tuple[list[LabelledSamples], dict[str, float]]:
    """From touches, those of ``rotations`` that each tells something of; and the share told of each."""
    labelled_samples: list[LabelledSamples] = []
    told: dict[str, float] = {}
    for touch in seen:
        some = touch.some(FRAMES_A_TAKE).readings
        shares = {name: posterior.told(name, some) for name in touch.rotations if name in rotations}
        names = tuple(name for name, share in shares.items() if share >= LEAST_TOLD)
        reference = np.full((len(touch.take.time_s), len(names)), np.nan)
        for column, name in enumerate(names):
            reference[touch.rows, column] = posterior.angles(name, touch.take.readings[touch.rows])
            told[name] = max(told.get(name, 0.0), shares[name])
        smooth = touch.take.readings.astype(float)
        smooth[touch.rows] = touch.readings
        if names:
            labelled_samples.append(_labelled_samples(touch.take, smooth, names, reference, "ik"))
    return labelled_samples, told


def counted(labelled_samples: Iterable[LabelledSamples], told: dict[str, float]) -> tuple[SampleCount, ...]:
    counts: dict[tuple[str, Kind], int] = {}
    for one in labelled_samples:
        for column, name in enumerate(one.take.rotations):
            if name in one.ruled:
                continue
            count = int(np.isfinite(one.take.reference[:, column]).sum())
            counts[name, one.kind] = counts.get((name, one.kind), 0) + count
    return tuple(
        SampleCount(name, kind, count, told.get(name) if kind == "ik" else None)
        for (name, kind), count in counts.items()
        if count
    )


def labelled_layout(layout: Layout, told: Iterable[str]) -> Layout:
    """A joint without a sensor that touches tell of is read from all sensors of its rule, not from one fixed
    mixture of them: nobody told the mixture."""
    items = [
        Correspondence(item.rotation, "MS1R", item.sensors)
        if item.simulated is not None and item.rotation in told
        else item
        for item in layout.correspondences
    ]
    return replace(layout, correspondences=tuple(items))


def with_open_variance(
    model: CalibrationModel, labelled_samples: Sequence[LabelledSamples], posterior: TouchPosterior
) -> CalibrationModel:
    """The model claiming, beside the noise of a frame, what the session left open."""
    return replace(
        model, rotations=tuple(_claiming(item, labelled_samples, posterior) for item in model.rotations)
    )


def _claiming(
    item: RotationModel, labelled_samples: Sequence[LabelledSamples], posterior: TouchPosterior
) -> RotationModel:
    regressor = item.regressor
    if not isinstance(regressor, LinearRegressor | ProcessRegressor):
        return item  # a rule has the noise of what it follows
    left = [np.empty(0)]
    for one in labelled_samples:
        if item.rotation in one.take.rotations:
            angle = one.take.reference[:, one.take.rotations.index(item.rotation)]
            some = one.take.readings[np.isfinite(angle)]
            left.append(posterior.variance(item.rotation, some[:: max(1, len(some) // FRAMES_A_TAKE)]))
    variance = regressor.noise_variance + float(np.concatenate(left).mean())
    claiming = replace(regressor, noise_variance=variance)
    return replace(item, regressor=claiming, uncertain_above_deg=uncertain_above(variance))


def _as_read(take: Take, posterior: TouchPosterior) -> np.ndarray:
    """(N, R): what the likeliest calibration reads where an angle is known."""
    found = take.reference_at_frames(take.rotations)
    for column, name in enumerate(take.rotations):
        known = np.isfinite(found[:, column])
        found[known, column] = posterior.angles(name, take.readings[known])
    return found


def _labelled_samples(
    take: Take,
    readings: np.ndarray,
    rotations: tuple[str, ...],
    reference: np.ndarray,
    kind: Kind,
    ruled: tuple[str, ...] = (),
) -> LabelledSamples:
    labelled = replace(
        take, readings=readings, rotations=rotations, reference_time_s=take.time_s, reference=reference
    )
    return LabelledSamples(labelled, kind, ruled)
