"""What a person does to calibrate a glove, and to try it: named segments of motion.

The sampling of Wang & Neff 2013, section 5.1: key poses held (5.1.1); the spread between fingers held by a
widget at 0, 10, 20 and 30 degrees while the fingers bend freely (5.1.2; here a comb holds all three gaps at
once); thumb and wrist through their ranges; then some free motion. About 40 seconds in all.
The evaluation visits the nine poses of Table 3, each time a little differently.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from glovecal_models.errors import BadInput
from glovecal_models.names import did_you_mean
from glovecal_models.simulation.hand_motion import (
    HandMotion,
    PostureSequence,
    Sweep,
    Unrest,
    free_motion,
    posture_vector,
    within_range,
)
from glovecal_models.simulation.simulated_hand import DRIVEN, FINGERS, KEY_POSES, POSTURES, TABLE_3_POSES

WIDGET_DEG = (0.0, 10.0, 20.0, 30.0)
GAPS = ("IM_ABD", "MR_ABD", "RP_ABD")
CROSS_COUPLE_S, THUMB_S, WRIST_S, FREE_S = 4.0, 6.5, 4.0, 5.0
HOLD_S, MOVE_S = 1.0, 0.6
REPEAT_SD_DEG = 2.5
"""How far a person's pose is from the last time it was taken."""


@dataclass(frozen=True)
class Segment:
    """A named stretch of motion, of any hand."""

    name: str
    motion: HandMotion
    unrest: Unrest

    @property
    def duration_s(self) -> float:
        return self.motion.duration_s

    def driven(self, time_s: np.ndarray) -> np.ndarray:
        """Driven rotations, shape (N, len(DRIVEN)), degrees; time 0 is the segment's start."""
        return self.motion.driven(time_s) + self.unrest.driven(time_s)

    def poses(self, time_s: np.ndarray) -> tuple[str, ...]:
        return self.motion.poses(time_s)


def sampling_protocol(seed: int) -> list[Segment]:
    """All segments a new subject records, in order."""
    cross_couple = [cross_couple_segment(seed, widget) for widget in WIDGET_DEG]
    return [
        key_pose_segment(seed),
        *cross_couple,
        thumb_segment(seed),
        wrist_segment(seed),
        free_segment(seed),
    ]


def key_pose_segment(seed: int) -> Segment:
    """The four key poses held, from flat and back to flat."""
    return _held_poses("key_poses", (*KEY_POSES, "flat"), np.random.default_rng([seed, 10]))


def evaluation_segment(seed: int) -> Segment:
    """The nine poses of Table 3 held, with transitions."""
    return _held_poses("evaluation", TABLE_3_POSES, np.random.default_rng([seed, 20]))


def cross_couple_segment(seed: int, widget_deg: float) -> Segment:
    """All gaps between fingers held at ``widget_deg``, the fingers bending freely and each by itself."""
    random = np.random.default_rng([seed, 11, round(widget_deg)])
    swings = {f"{finger}_MCP": (-5.0, 90.0) for finger in FINGERS}
    swings |= {f"{finger}_PIP": (0.0, 100.0) for finger in FINGERS}
    swings |= dict.fromkeys(GAPS, (widget_deg, widget_deg))
    return Segment(
        f"cross_couple_{widget_deg:.0f}",
        _sweep("flat", swings, (0.5, 1.2), CROSS_COUPLE_S, random),
        Unrest(random, held=GAPS),
    )


def thumb_segment(seed: int) -> Segment:
    """The thumb's four rotations through their ranges, each at its own speed."""
    random = np.random.default_rng([seed, 12])
    swings = {"T_TMC": (0.0, 60.0), "TI_ABD": (8.0, 66.0), "T_MCP": (0.0, 50.0), "T_IP": (0.0, 78.0)}
    return Segment("thumb", _sweep("rest", swings, (0.4, 1.3), THUMB_S, random), Unrest(random))


def wrist_segment(seed: int) -> Segment:
    """Flexion and deviation of the wrist through their ranges, fingers at rest."""
    random = np.random.default_rng([seed, 13])
    swings = {"W_FLEX": (-60.0, 70.0), "W_ABD": (-28.0, 19.0)}
    return Segment("wrist", _sweep("rest", swings, (0.45, 1.2), WRIST_S, random), Unrest(random))


def free_segment(seed: int, duration_s: float = FREE_S, part: int = 0) -> Segment:
    """Unguided motion; every ``part`` of the same seed is different."""
    random = np.random.default_rng([seed, 14, part])
    return Segment("free", free_motion(duration_s, random), Unrest(random))


MOTIONS = ("free", "key_poses", "cross_couple", "thumb", "wrist", "protocol", "evaluation")


def segments(motion: str, seed: int) -> list[Segment]:
    """The segments of one of ``MOTIONS``. Raises BadInput for another name."""
    if motion == "protocol":
        return sampling_protocol(seed)
    if motion == "cross_couple":
        return [cross_couple_segment(seed, widget) for widget in WIDGET_DEG]
    single = {
        "free": free_segment,
        "key_poses": key_pose_segment,
        "thumb": thumb_segment,
        "wrist": wrist_segment,
        "evaluation": evaluation_segment,
    }
    if motion not in single:
        raise BadInput(f"no motion {motion!r}; {did_you_mean(motion, MOTIONS)}")
    return [single[motion](seed)]


def _held_poses(name: str, poses: Sequence[str], random: np.random.Generator) -> Segment:
    exact = np.array([posture_vector(POSTURES[pose]) for pose in poses])
    taken = within_range(exact + REPEAT_SD_DEG * random.standard_normal(exact.shape))
    motion = PostureSequence(
        taken, poses, hold_s=[HOLD_S] * len(poses), move_s=[MOVE_S] * (len(poses) - 1), random=random
    )
    return Segment(name, motion, Unrest(random))


def _sweep(
    start: str,
    swings: Mapping[str, tuple[float, float]],
    speeds_hz: tuple[float, float],
    duration_s: float,
    random: np.random.Generator,
) -> Sweep:
    """Joints of ``swings`` between two angles at speeds spread over ``speeds_hz``; the others stay."""
    posture = posture_vector(POSTURES[start])
    low, high = posture.copy(), posture.copy()
    speed = np.zeros(len(DRIVEN))
    moving = [DRIVEN.index(name) for name in swings]
    low[moving], high[moving] = np.array(list(swings.values())).T
    speed[moving] = random.permutation(np.linspace(*speeds_hz, len(moving)))
    phase = random.uniform(0, 2 * np.pi, len(DRIVEN))
    return Sweep(posture, low, high, speed, phase, duration_s)
