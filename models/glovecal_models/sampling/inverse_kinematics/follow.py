"""Hands through a sequence of frames whose fingertips do what they are known to do.

Each step is one of clamped damped least squares (Wang & Neff 2013, equations 2 and 3) that keeps joint
limits. It is counted in standard deviations of the hand's shape, in which every joint is equally stiff. Then,
with z the way back to the shape, equation (2) is the least change of (angles - shape) that carries the tips
by e: its fixed point is the likeliest hand (equation 4) whose tips are where they should be.

As printed, z points up the gradient and would drive the hand away from its shape; here it points down. The
paper slows joints beyond their range by a factor w; here a joint never leaves its range: it is held at the
limit (w = 0) as long as it would go beyond, and the others take over its share.

Predicted angles without the sensors' noise: hands move on smooth curves, noise is new in every frame.

Where the calibration hardly knows a joint, a touch would hand it the noise of all others, many times over.

The shape a hand is believed to have before its fingertips are looked at, and how firmly.

At rest where nothing is known, else what a calibration says about the whole hand in each frame of a take.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.predictor import BY_RULE, FAULTY_SENSOR, GlovePredictor
from glovecal_models.calibration.samples import require_layout
from glovecal_models.errors import BadInput
from glovecal_models.hand.rotations import HAND_ROTATIONS, RULES, completed
from glovecal_models.sampling.inverse_kinematics.contact import Contact, TipChains
from glovecal_models.takes.take import Take

THUMB_SD_DEG, FINGER_SD_DEG = 15.0, 10.0
"""How far a hand is from its rest where nothing is known: the thumb is the less stiff (section 5.2.2)."""
LONGEST_PULL_MM = 20.0
"""e_max of equation (3)."""
DAMPING_PER_MM2 = 1e-4
"""The damping factor over the squared distance, as a share of the Jacobian's size: 1 at 100 mm."""
SINGULAR = 1e-9
"""Share of the largest squared slope that stands in for directions in which nothing moves."""
LEAST_SQUARE = 1e-6
MOST_EXCHANGES = 8
"""Of joints held at a limit for others, within one step."""
WINDOW_S = 0.15
"""A parabola follows a hand over this long: its tremor, the fastest it does, is at 7 to 11 Hz."""
DEGREE = 2
GAP = 3.0
"""Frames this many usual intervals apart do not belong to one curve."""


@dataclass(frozen=True)
class HandShape:
    """N frames of K rotations, each normally distributed by itself (Wang & Neff 2013, equation 4).

    The inverse squares of ``sd_deg`` are the paper's stiffness coefficients.
    """

    rotations: tuple[str, ...]
    centre_deg: np.ndarray
    """(N, K)."""
    sd_deg: np.ndarray
    """(N, K)."""

    def __post_init__(self) -> None:
        shape = np.shape(self.centre_deg)
        if len(shape) != 2 or shape[1] != len(self.rotations) or np.shape(self.sd_deg) != shape:
            raise BadInput(
                f"a hand's shape has angles {shape} and standard deviations {np.shape(self.sd_deg)}, "
                f"expected (N, {len(self.rotations)}) for both"
            )
        if not np.isfinite(self.centre_deg).all() or not (np.asarray(self.sd_deg) > 0).all():
            raise BadInput("a hand's shape needs finite angles and standard deviations above 0 degrees")

    def __len__(self) -> int:
        return len(self.centre_deg)

    @classmethod
    def at_rest(cls, rotations: Sequence[str]) -> HandShape:
        """A relaxed hand: what is left to say without a calibration."""
        rest = completed((), np.empty((1, 0)), rotations)
        firmness = [THUMB_SD_DEG if name.startswith("T") else FINGER_SD_DEG for name in rotations]
        return cls(tuple(rotations), rest, np.array(firmness)[None])

    def misfit(self, angles_deg: np.ndarray) -> np.ndarray:
        """How far hands (N, K) are from this shape, in standard deviations of the whole, (N,)."""
        return np.sqrt((((angles_deg - self.centre_deg) / self.sd_deg) ** 2).sum(axis=1))


RULE_SD_DEG = 4.0
"""How far a person's last joints are from the rule: 2/3 of the bend before them is a mean over people."""
LEAST_SD_DEG = 0.5
"""No calibration is surer than this."""


@dataclass(frozen=True)
class PredictedHand:
    """N frames of all rotations of a hand."""

    mean_deg: np.ndarray
    """(N, R)."""
    sd_deg: np.ndarray
    """(N, R); of what nobody calibrated: as wide as a resting hand, or a rule, may be wrong."""
    is_faulty: np.ndarray
    """(N, R): its sensor fails."""

    def frames(self, chosen: slice) -> PredictedHand:
        """These frames alone."""
        return PredictedHand(self.mean_deg[chosen], self.sd_deg[chosen], self.is_faulty[chosen])

    def shape(self, chains: TipChains) -> HandShape:
        """Of the rotations that move these fingertips."""
        columns = chains.columns
        return HandShape(chains.rotations, self.mean_deg[:, columns], self.sd_deg[:, columns])


def predicted_hand(
    take: Take, model: CalibrationModel, rotations: Sequence[str] = HAND_ROTATIONS
) -> PredictedHand:
    """Every frame of ``take``, effects included; ``rotations``: those of the skeleton.

    Raises LayoutMismatch where a sensor is missing.
    """
    require_layout(take, model.layout)
    readings = take.readings[:, [take.sensors.index(name) for name in model.layout.sensors]]
    angles = GlovePredictor(model).predict_take(take.time_s, readings, take.context, take.wearing)
    names = model.rotation_names
    by_rule = (angles.flags & BY_RULE) > 0
    sd = np.where(by_rule, np.hypot(angles.sd, RULE_SD_DEG), np.maximum(angles.sd, LEAST_SD_DEG))
    known = dict(zip(names, sd.T, strict=True))
    faulty = dict(zip(names, ((angles.flags & FAULTY_SENSOR) > 0).T, strict=True))
    healthy = np.zeros(len(sd), dtype=bool)
    return PredictedHand(
        completed(names, angles.mean, rotations),
        np.column_stack([_sd(name, known, len(sd)) for name in rotations]),
        np.column_stack([faulty.get(name, healthy) for name in rotations]),
    )


def _sd(rotation: str, known: dict[str, np.ndarray], frames: int) -> np.ndarray:
    if rotation in known:
        return known[rotation]
    if rotation in RULES:
        followed = [(weight * _sd(name, known, frames)) ** 2 for name, weight in RULES[rotation].items()]
        return np.sqrt(sum(followed) + RULE_SD_DEG**2)
    return np.full(frames, THUMB_SD_DEG if rotation.startswith("T") else FINGER_SD_DEG)


def clamped_pull(missing_mm: np.ndarray) -> np.ndarray:
    """Vectors (G, C), none longer than ``LONGEST_PULL_MM`` (equation 3)."""
    lengths = np.sqrt((missing_mm * missing_mm).sum(axis=1, keepdims=True))
    return missing_mm * (LONGEST_PULL_MM / np.maximum(lengths, LONGEST_PULL_MM))


def clamped_step(
    slopes: np.ndarray, pull: np.ndarray, distance_mm: float, back: np.ndarray, room: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The step (K,), within ``room`` (2, K), and the force (M,) on the tips that goes with it.

    ``slopes``: J (M, K), mm a standard deviation. ``pull``: e (M,). ``distance_mm``: how far the tips are
    off altogether, for the damping. ``back``: z (K,), from here to the shape. At a fixed point ``back`` is
    -J^T force in every joint that is not at its limit.
    """
    low, high = room
    held, at_limit, force = np.zeros(len(back), dtype=bool), np.zeros_like(back), np.zeros_like(pull)
    for _ in range(MOST_EXCHANGES):
        left = pull - slopes @ at_limit
        force = _force(np.where(held, 0.0, slopes), left, distance_mm, back)
        wanted = back + force @ slopes
        beyond = (wanted < low) | (wanted > high)
        if (beyond == held).all():
            return np.clip(wanted, low, high), force
        held, at_limit = beyond, np.where(beyond, np.clip(wanted, low, high), 0.0)
    return _nearest_step(slopes, pull, back, room), force


def _nearest_step(slopes: np.ndarray, pull: np.ndarray, back: np.ndarray, room: np.ndarray) -> np.ndarray:
    """The step that brings the tips nearest, where the limits do not let them go the whole way."""
    from scipy.optimize import lsq_linear  # slow to load, and needed at the joint limits only

    little = np.sqrt(SINGULAR * (slopes * slopes).sum())
    rows = np.vstack([slopes, little * np.eye(len(back))])
    return lsq_linear(rows, np.concatenate([pull, little * back]), bounds=tuple(room)).x


def _force(free: np.ndarray, left: np.ndarray, distance_mm: float, back: np.ndarray) -> np.ndarray:
    """(J J^T + lambda^2 I)^-1 e - (J J^T)^-1 J z.

    Very large where the free joints cannot move the tips: that lets go of a held joint that can.
    """
    squares, directions = np.linalg.eigh(free @ free.T)
    largest = max(squares[-1], LEAST_SQUARE)
    squares = np.maximum(squares, 0.0) + SINGULAR * largest
    damping = (DAMPING_PER_MM2 * distance_mm**2) ** 2 * largest
    along, shape = left @ directions, (free @ back) @ directions
    return directions @ (along / (squares + damping) - shape / squares)


TIP_TOLERANCE_MM = 0.01
"""Tips this close are where they should be."""
STILL_DEG = 0.01
"""No joint moves further in the last step."""
STUCK_DEG = 1e-4
"""Nor does it here, where a finger is bent so that its tip cannot start on the way."""
LONGEST_STEP_DEG = 10.0
SCATTERED_STARTS = 8
"""Hands anywhere within the limits, tried where the way is barred from the last frame and from the shape."""
MOST_STEPS = 200
OSCILLATION_BACK_OFF, LEAST_POSTURE_GAIN = 0.8, 0.2
"""Once swayed, joints come back to their shape in smaller steps."""
AT_LIMIT_DEG = 1e-6


@dataclass(frozen=True)
class FollowedHands:
    """N frames of K rotations in the order of the chains'."""

    angles_deg: np.ndarray
    """(N, K), every one within its limits."""
    missing_mm: np.ndarray
    """(N,), how far the tips are from what they should do; small where the contact can be reached."""
    force: np.ndarray
    """(N, M), 1/mm: slope of the log probability by each component of the contact."""
    steps: np.ndarray
    """(N,)."""


def follow(
    chains: TipChains, contact: Contact, shape: HandShape, start_deg: np.ndarray | None = None
) -> FollowedHands:
    """The likeliest hands of ``shape`` that keep ``contact``: clamped damped least squares, frame by frame.

    Each frame starts from the solution of the one before, the first from ``start_deg`` (K,), else from its
    shape; where that does not lead there, from elsewhere. Solves equations (2) to (6) of Wang & Neff 2013 at
    once: the shape's standard deviations are the stiffness, and the tips meet where both chains are likeliest
    to. Raises BadInput where chains, contact and shape are of different fingers or rotations.
    """
    if contact.fingers != chains.fingers or shape.rotations != chains.rotations:
        raise BadInput(
            f"a contact of {', '.join(contact.fingers)} and a shape of {', '.join(shape.rotations)} were "
            f"given for chains of {', '.join(chains.fingers)}, which move by {', '.join(chains.rotations)}"
        )
    angles, missing = np.empty_like(shape.centre_deg), np.empty(len(shape))
    steps, forces = np.empty(len(shape), dtype=int), []
    at = shape.centre_deg[0] if start_deg is None else np.asarray(start_deg, dtype=float)
    low, high = chains.limits_deg.T
    scattered = np.random.default_rng(0).uniform(low, high, (SCATTERED_STARTS, len(low)))
    for frame, centre in enumerate(shape.centre_deg):
        problem = _Frame(chains, contact, frame, centre, shape.sd_deg[frame])
        found = problem.solved_from([at, centre, *scattered])
        at = angles[frame] = found.angles_deg
        missing[frame], steps[frame] = found.distance_mm, found.steps
        forces.append(found.force)
    return FollowedHands(angles, missing, np.array(forces), steps)


@dataclass(frozen=True)
class _Solution:
    angles_deg: np.ndarray
    distance_mm: float
    force: np.ndarray
    steps: int


@dataclass(frozen=True)
class _Frame:
    chains: TipChains
    contact: Contact
    frame: int
    centre_deg: np.ndarray
    sd_deg: np.ndarray

    def solved_from(self, starts_deg: Sequence[np.ndarray]) -> _Solution:
        """The first that reaches, else the nearest."""
        best = self.solved(starts_deg[0])
        for start in starts_deg[1:]:
            if best.distance_mm <= TIP_TOLERANCE_MM:
                break
            best = min(best, self.solved(start), key=lambda each: each.distance_mm)
        return best

    def solved(self, start_deg: np.ndarray) -> _Solution:
        """Steps until the joints are still. Where they oscillate, the gain towards the posture falls."""
        low, high = self.chains.limits_deg.T
        at, before, steps = np.clip(start_deg, low, high), np.zeros(len(low)), 0
        posture_gain = most_gain = 1.0
        while True:
            step, distance, force = self._step(at, posture_gain)
            furthest = float(np.abs(step).max())
            still = STILL_DEG * posture_gain if distance < TIP_TOLERANCE_MM else STUCK_DEG
            if furthest < still or steps == MOST_STEPS:
                return _Solution(at, distance, force / posture_gain, steps)
            at = np.clip(at + step * min(1.0, LONGEST_STEP_DEG / max(furthest, STILL_DEG)), low, high)
            if step @ before < 0:
                posture_gain, most_gain = (
                    posture_gain / 2,
                    max(OSCILLATION_BACK_OFF * posture_gain, LEAST_POSTURE_GAIN),
                )
            else:
                posture_gain = min(most_gain, 1.5 * posture_gain)
            before, steps = step, steps + 1

    def _step(self, at: np.ndarray, posture_gain: float) -> tuple[np.ndarray, float, np.ndarray]:
        """The step (K,) in degrees, the distance in mm, the force."""
        tips, slopes = self.chains.tips_and_slopes(at[None])
        missing, rows = self.contact.missing(tips[0], self.frame)
        distance = float(np.sqrt((missing * missing).sum()))
        by_angle = rows.reshape(missing.size, -1) @ slopes[0].reshape(-1, len(at)) * self.sd_deg
        room = (self.chains.limits_deg.T - at) / self.sd_deg
        back = posture_gain * (self.centre_deg - at) / self.sd_deg
        step, force = clamped_step(by_angle, clamped_pull(missing).ravel(), distance, back, room)
        return step * self.sd_deg, distance, force


def steadied(time_s: np.ndarray, angles_deg: np.ndarray, window_s: float = WINDOW_S) -> np.ndarray:
    """Each frame's place on the parabola through its neighbours of ``window_s`` (Savitzky & Golay 1964),
    shape (N, R).

    Stretches that are too short, or frames too rare, for more than a parabola's own points stay as they are.
    """
    if len(time_s) < DEGREE + 2:
        return angles_deg
    intervals = np.diff(time_s)
    usual = float(np.median(intervals))
    window = 2 * round(window_s / usual / 2) + 1
    if window < DEGREE + 2:
        return angles_deg
    from scipy.signal import savgol_filter  # takes a second to load, which most commands need not wait for

    smooth = angles_deg.copy()
    ends = [0, *np.flatnonzero(intervals > GAP * usual) + 1, len(time_s)]
    for start, end in itertools.pairwise(ends):
        if end - start >= window:
            smooth[start:end] = savgol_filter(angles_deg[start:end], window, DEGREE, axis=0)
    return smooth
