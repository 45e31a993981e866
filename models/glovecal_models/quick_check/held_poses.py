"""The poses that were held in a take: where the hand was still, and how long.

What angles a named pose has: as the subject's own takes show it, else as a usual hand takes it. What a model
gets wrong in each pose, as one witness; poses that contradict the prior and each other are excluded, with the
reason.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.predictor import GlovePredictor
from glovecal_models.calibration.samples import SensorSensitivity
from glovecal_models.effects.base.signals import Settings, in_joint_units
from glovecal_models.errors import BadInput
from glovecal_models.quick_check.answer import CheckedPose, RefusedPose
from glovecal_models.quick_check.key_poses import KEY_POSES_DEG
from glovecal_models.quick_check.wearing_shift import PoseError, WearingShift
from glovecal_models.takes.still_hand import block_means, stays, still_stretches
from glovecal_models.takes.take import Take

SHORTEST_HOLD_S = 0.4
SETTLING_S = 0.25
"""The beginning of a named pose is still on its way."""
REFERENCE_SD_DEG = 0.5
"""Of a measured angle's mean over a hold: what a reference is off by beside its noise."""
CONTRADICTS = 16.0
"""Mean squared surprise of a pose's rotations, given the others, above which something is wrong with it."""
TURNED_SHARE = 0.25
"""With more of the judged rotations moving the wrong way, the glove is of another hand."""
LEAST_SWING_DEG = 20.0
REPEAT_SD_DEG = 2.5
"""How far a person's pose is from the last time it was taken."""
OTHER_HAND_SD_DEG = 6.0
"""How far it is from a usual hand's."""


@dataclass(frozen=True, eq=False)
class HeldPose:
    """A stretch of one take in which the hand was still."""

    take: Take
    frames: np.ndarray
    """Rows of the take."""
    name: str = ""
    """As the take named it, "" for a pose without a name."""

    @property
    def start_s(self) -> float:
        return float(self.take.time_s[self.frames[0]])

    @property
    def seconds(self) -> float:
        return float(self.take.time_s[self.frames[-1]] - self.take.time_s[self.frames[0]])

    @property
    def label(self) -> str:
        """What a person finds it by."""
        what = f"pose {self.name}" if self.name else "the pose"
        return f"{what} at {self.start_s:.1f} s of take {self.take.name}"


@dataclass(frozen=True)
class NotHeld:
    """A pose that the take names but in which the hand was not still for long enough."""

    label: str
    reason: str


def held_poses(take: Take, ranges: Mapping[str, float]) -> tuple[list[HeldPose], list[NotHeld]]:
    """The poses of a take, in the order of time; ``ranges`` is each sensor's trained range, in readings.

    In a take with pose names each name's run is one pose; otherwise every still stretch is.
    """
    if take.poses is None or not any(take.poses):
        every = np.arange(len(take.time_s))
        return [HeldPose(take, frames) for frames in _still(take, every, ranges)], []
    found, missed = [], []
    for name, run in stays(take.poses):
        if not name:
            continue
        settled = run[take.time_s[run] >= take.time_s[run[0]] + SETTLING_S]
        stretches = _still(take, settled, ranges)
        if stretches:
            found.append(HeldPose(take, max(stretches, key=len), name))
        else:
            label = f"pose {name} at {take.time_s[run[0]]:.1f} s of take {take.name}"
            moving = _most_moving(take, run, ranges)
            missed.append(NotHeld(label, f"not held still for {SHORTEST_HOLD_S:g} s ({moving})"))
    return found, missed


def _still(take: Take, frames: np.ndarray, ranges: Mapping[str, float]) -> list[np.ndarray]:
    """Stretches within ``frames`` in which the hand is still."""
    _, readings, spans = _in_range(take, frames, ranges)
    found = still_stretches(take.time_s[frames], readings, spans, shortest_s=SHORTEST_HOLD_S)
    return [frames[rows] for rows in found]


def _in_range(
    take: Take, frames: np.ndarray, ranges: Mapping[str, float]
) -> tuple[list[str], np.ndarray, np.ndarray]:
    """The sensors whose range is known, their readings (N, S) at ``frames``, and their ranges (S,)."""
    sensors = [name for name in take.sensors if ranges.get(name, 0.0) > 0]
    readings = take.readings[frames][:, [take.sensors.index(name) for name in sensors]]
    return sensors, readings, np.array([ranges[name] for name in sensors])


def _most_moving(take: Take, frames: np.ndarray, ranges: Mapping[str, float]) -> str:
    sensors, readings, spans = _in_range(take, frames, ranges)
    if len(frames) < 2 or not sensors:
        return "too few frames"
    share = block_means(take.time_s[frames], readings)[0] / spans
    moved = np.ptp(share, axis=0)
    worst = int(np.argmax(moved))
    return f"{sensors[worst]} moves through {100 * moved[worst]:.0f} % of its range"


@dataclass(frozen=True)
class KnownPose:
    """Angles of one pose by rotation, and how well they are known. Degrees."""

    angles: Mapping[str, float]
    sd: Mapping[str, float]


PoseBook = Mapping[str, KnownPose]


def usual_poses() -> dict[str, KnownPose]:
    """Flat, fist and spread of a usual hand."""
    return {
        name: KnownPose(angles, dict.fromkeys(angles, OTHER_HAND_SD_DEG))
        for name, angles in KEY_POSES_DEG.items()
    }


def own_poses(takes: Iterable[Take], ranges: Mapping[str, float]) -> dict[str, KnownPose]:
    """The poses that ``takes`` name, with the angles measured while they were held; usual ones beside them.

    ``ranges`` is each sensor's trained range, in readings.
    """
    seen: dict[str, dict[str, list[float]]] = {}
    for take in takes:
        if take.poses is None or not take.rotations:
            continue
        reference = take.reference_at_frames(take.rotations)
        for pose in held_poses(take, ranges)[0]:
            for column, rotation in enumerate(take.rotations):
                angles = reference[pose.frames, column]
                if np.isfinite(angles).any():
                    measured = float(np.nanmean(angles))
                    seen.setdefault(pose.name, {}).setdefault(rotation, []).append(measured)
    return usual_poses() | {name: _known(angles) for name, angles in seen.items()}


def _known(angles: Mapping[str, list[float]]) -> KnownPose:
    """Means; the next time the pose is off by as much as from time to time before."""
    means = {rotation: float(np.mean(values)) for rotation, values in angles.items()}
    sd = {}
    for rotation, values in angles.items():
        # One time alone tells no spread: it leans on the usual one, as if seen twice before.
        square = (np.var(values) * len(values) + 2 * REPEAT_SD_DEG**2) / (len(values) + 1)
        sd[rotation] = float(np.sqrt(square * (1 + 1 / len(values))))
    return KnownPose(means, sd)


@dataclass(frozen=True, eq=False)
class ObservedPose:
    """One held pose with what is known of its angles; arrays are (L,) over the trained rotations, degrees."""

    pose: HeldPose
    witness: PoseError
    predicted: np.ndarray
    """Without a shift."""
    angle: np.ndarray
    """NaN where nothing is known."""
    measured: np.ndarray
    """True where the angle was measured, not told by the pose's name."""
    saturated: tuple[str, ...]
    """Sensors at the end of what the hardware can send; their rotations are left out."""


def pose_errors(
    model: CalibrationModel,
    units: Settings,
    poses: Sequence[HeldPose],
    sensitivity: SensorSensitivity,
    known: PoseBook,
) -> list[ObservedPose]:
    """For each of ``poses``; ``units`` are the joints' own units (``own_centre_deg``, ``own_scale_deg``)."""
    predictor = GlovePredictor(model)
    predictions = {id(pose.take): _Predicted(predictor, pose.take, sensitivity) for pose in poses}
    found = []
    for pose in poses:
        take = predictions[id(pose.take)]
        angle, sd, measured = _known_angles(pose, sensitivity.rotations, known)
        saturated = _saturated(pose, model)
        blind = (sensitivity.slope[:, [name in saturated for name in sensitivity.sensors]] != 0).any(axis=1)
        angle = np.where(blind, np.nan, angle)
        predicted = take.mean[pose.frames].mean(axis=0)
        joint = in_joint_units(take.base[pose.frames].mean(axis=0)[None], units)[0]
        # Not divided by the frames: what the regressor is off by here it is off by in all of them.
        variance = (take.sd[pose.frames] ** 2).mean(axis=0) + sd**2
        witness = PoseError(angle - predicted, joint, variance)
        found.append(ObservedPose(pose, witness, predicted, angle, measured, saturated))
    return found


class _Predicted:
    """A take's frames (N, L) as the model predicts them without a shift, degrees."""

    def __init__(self, predictor: GlovePredictor, take: Take, sensitivity: SensorSensitivity) -> None:
        rows = [predictor.rotations.index(name) for name in sensitivity.rotations]
        readings = take.readings[:, [take.sensors.index(name) for name in predictor.sensors]]
        angles = predictor.predict(readings)
        self.base, self.sd = angles.mean[:, rows].copy(), angles.sd[:, rows]
        corrected = predictor.predict_take(take.time_s, readings, take.context, take.wearing)
        self.mean = corrected.mean[:, rows]


def _known_angles(
    pose: HeldPose, rotations: Sequence[str], known: PoseBook
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Angle, standard deviation and whether it was measured, (L,) each."""
    reference = pose.take.reference_at_frames(rotations)[pose.frames]
    finite = np.isfinite(reference)
    measured = finite.mean(axis=0) >= 0.5
    sums = np.where(finite, reference, 0.0).sum(axis=0)
    angle = np.where(measured, sums / np.maximum(finite.sum(axis=0), 1), np.nan)
    sd = np.full(len(rotations), REFERENCE_SD_DEG)
    if pose.name in known:
        book = known[pose.name]
        for lane, rotation in enumerate(rotations):
            if not measured[lane] and rotation in book.angles:
                angle[lane], sd[lane] = book.angles[rotation], book.sd[rotation]
    return angle, sd, measured


def _saturated(pose: HeldPose, model: CalibrationModel) -> tuple[str, ...]:
    """Sensors that stand at an end of the hardware's range for most of the pose."""
    if model.layout.counts is None:
        return ()
    low, high = model.layout.counts
    readings = pose.take.readings[pose.frames]
    at_end = ((readings <= low) | (readings >= high)).mean(axis=0) > 0.5
    return tuple(name for name, stuck in zip(pose.take.sensors, at_end, strict=True) if stuck)


def checked_poses(
    poses: Sequence[ObservedPose], prior: WearingShift, rotations: Sequence[str], known: PoseBook
) -> tuple[list[CheckedPose], list[PoseError], list[RefusedPose]]:
    """The poses to learn from, each as a witness, and those left out.

    Raises BadInput when too few are left to believe.
    """
    unknown = [item for item in poses if not item.witness.known.any()]
    refused = [RefusedPose(item.pose.label, _why_unknown(item)) for item in unknown]
    left = [item for item in poses if item.witness.known.any()]
    if not left:
        reasons = "; ".join(f"{item.pose}: {item.reason}" for item in refused[:3])
        raise BadInput(
            f"no angle is known in any of the poses ({reasons}); measure r.ROTATION columns, or hold poses "
            f"that have a name: {', '.join(known)}"
        )
    judged = len(left)
    contradicting: list[ObservedPose] = []
    while (worst := _worst(left, prior)) is not None:
        left.remove(worst)
        contradicting.append(worst)
    if len(left) < max(1, (judged + 1) // 2):
        raise BadInput(_nothing_fits([*left, *contradicting], contradicting, rotations, known))
    refused += [RefusedPose(item.pose.label, _mistaken(item, rotations, known)) for item in contradicting]
    return [_checked(item, left, prior) for item in left], [item.witness for item in left], refused


def _worst(poses: Sequence[ObservedPose], prior: WearingShift) -> ObservedPose | None:
    """Among the poses that the others contradict the one least likely by itself; None: all agree."""
    bad = [item for item in poses if _others(item, poses, prior).contradiction(item.witness) > CONTRADICTS]
    return max(bad, key=lambda item: prior.contradiction(item.witness), default=None)


def _others(item: ObservedPose, poses: Sequence[ObservedPose], prior: WearingShift) -> WearingShift:
    return prior.after(other.witness for other in poses if other is not item)


def _checked(item: ObservedPose, poses: Sequence[ObservedPose], prior: WearingShift) -> CheckedPose:
    witness, known = item.witness, np.flatnonzero(item.witness.known)
    others = _others(item, poses, prior)
    left = witness.error[known] - others.rows(known, witness.joint[known]) @ others.mean
    measured = int((item.measured & witness.known).sum())
    return CheckedPose(
        item.pose.label,
        item.pose.seconds,
        measured,
        len(known) - measured,
        item.saturated,
        _rms(witness.error[known]),
        _rms(left) if len(poses) > 1 else None,
    )


def _why_unknown(item: ObservedPose) -> str:
    if item.saturated:
        return f"sensors at the end of their range: {', '.join(item.saturated)}"
    if item.pose.name:
        return f"nothing was measured, and the angles of pose {item.pose.name!r} are not known"
    return "nothing was measured, and the pose has no name"


def _mistaken(item: ObservedPose, rotations: Sequence[str], known: PoseBook) -> str:
    error = np.where(item.witness.known, np.abs(item.witness.error), 0.0)
    lane = int(np.argmax(error / np.sqrt(np.where(item.witness.known, item.witness.variance, 1.0))))
    reason = (
        f"contradicts the other poses and what a new wearing may shift: {rotations[lane]} is predicted "
        f"{item.predicted[lane]:.0f} degrees, but should be {item.angle[lane]:.0f}"
    )
    looks = _looks_like(item, rotations, known)
    return f"{reason}; the hand looks like pose {looks}" if looks and looks != item.pose.name else reason


def _looks_like(item: ObservedPose, rotations: Sequence[str], known: PoseBook) -> str | None:
    """The known pose nearest to the predicted angles."""
    distance = {}
    for name, pose in known.items():
        lanes = [lane for lane, rotation in enumerate(rotations) if rotation in pose.angles]
        if lanes:
            angles = np.array([pose.angles[rotations[lane]] for lane in lanes])
            distance[name] = _rms(item.predicted[lanes] - angles)
    return min(distance, key=distance.__getitem__, default=None)


def _nothing_fits(
    poses: Sequence[ObservedPose],
    contradicting: Sequence[ObservedPose],
    rotations: Sequence[str],
    known: PoseBook,
) -> str:
    count = f"{len(contradicting)} of {len(poses)} poses contradict this model or each other"
    turned, judged = _turned(poses, rotations)
    if judged and len(turned) >= max(1, TURNED_SHARE * judged):
        return (
            f"{count}: {', '.join(turned[:4])} {'moves' if len(turned) == 1 else 'move'} the other way than "
            "predicted; is this the glove of the other hand, or another glove?"
        )
    worst = contradicting[0]
    return (
        f"{count} ({worst.pose.label}: {_mistaken(worst, rotations, known)}); were the poses mistaken, "
        "or is this another person or another glove? Nothing was learned"
    )


def _turned(poses: Sequence[ObservedPose], rotations: Sequence[str]) -> tuple[list[str], int]:
    """Rotations whose known angle falls while the predicted one rises, and how many could be judged."""
    angle = np.array([np.where(item.witness.known, item.angle, np.nan) for item in poses])
    predicted = np.array([item.predicted for item in poses])
    turned, judged = [], 0
    for lane, name in enumerate(rotations):
        seen = np.isfinite(angle[:, lane])
        x, y = predicted[seen, lane], angle[seen, lane]
        if seen.sum() < 2 or np.ptp(y) < LEAST_SWING_DEG:
            continue
        judged += 1
        if float((x - x.mean()) @ (y - y.mean())) < 0:
            turned.append(name)
    return turned, judged


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))
