"""What a person does to calibrate a glove, and to try it: named segments of motion.

The sampling of Wang & Neff 2013, section 5.1: key poses held (5.1.1); the spread between fingers held by a
widget at 0, 10, 20 and 30 degrees while the fingers bend freely (5.1.2; here a comb holds all three gaps at
once); thumb and wrist through their ranges; then some free motion. About 40 seconds in all.
The evaluation visits the nine poses of Table 3, each time a little differently.

How a simulated hand moves: between postures, to and fro, and never quite still.

Hands move from posture to posture on smooth bell-shaped speeds (minimum jerk: Flash & Hogan 1985), fingers
starting a little apart; held, they wander slowly and tremble at 7 to 11 Hz. All motions are functions of
time, so that any frame can be asked for by itself.

Free motion takes postures as hands take them without being told: Santello, Flanders & Soechting 1998 found
that two synergies (closing all fingers, and knuckles against middle joints) carry most of the posture of
grasping hands; spread, thumb opposition and single fingers make the rest. The sizes are typical values.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from glovecal_models.errors import BadInput
from glovecal_models.hand.rotations import ACTIVE_RANGE_DEG
from glovecal_models.names import did_you_mean
from glovecal_models.simulation.simulated_hand import DRIVEN, KEY_POSES, LONG_FINGERS, POSTURES, TABLE_3_POSES

WANDER_DEG = 0.4
TREMOR_DEG = 0.12
"""Amplitudes of each of the two slow and three fast waves of a hand that tries to be still."""
PACE_S = 10.0
"""In which swings that change their speed get fast and slow again."""
WIDGET_DEG = (0.0, 10.0, 20.0, 30.0)
GAPS = ("IM_ABD", "MR_ABD", "RP_ABD")
CROSS_COUPLE_S, THUMB_S, WRIST_S, FREE_S = 4.0, 6.5, 4.0, 5.0
HOLD_S, MOVE_S = 1.0, 0.6
REPEAT_SD_DEG = 2.5
"""How far a person's pose is from the last time it was taken."""


class HandMotion(Protocol):
    """The driven rotations over time."""

    @property
    def duration_s(self) -> float: ...

    def driven(self, time_s: np.ndarray) -> np.ndarray:
        """Angles, shape (N, len(DRIVEN)), degrees, at ``time_s`` (N,), 0 at the motion's start."""
        ...

    def poses(self, time_s: np.ndarray) -> tuple[str, ...]:
        """The name of the pose held at each time, "" in between."""
        ...


def minimum_jerk(share: np.ndarray) -> np.ndarray:
    """Progress 0..1 of a minimum-jerk movement after ``share`` of its time (held at the ends)."""
    x = np.clip(share, 0.0, 1.0)
    return x**3 * (10 - 15 * x + 6 * x * x)


def posture_vector(posture: Mapping[str, float]) -> np.ndarray:
    """Angles in the order of DRIVEN."""
    return np.array([posture[name] for name in DRIVEN])


def within_range(driven: np.ndarray) -> np.ndarray:
    """Angles held within each joint's active range."""
    low, high = np.array([ACTIVE_RANGE_DEG[name] for name in DRIVEN]).T
    return np.clip(driven, low, high)


class PostureSequence:
    """Postures one after another, each held for a while."""

    def __init__(
        self,
        postures: np.ndarray,
        names: Sequence[str],
        *,
        hold_s: Sequence[float],
        move_s: Sequence[float],
        random: np.random.Generator,
    ) -> None:
        """``postures`` (K, len(DRIVEN)); ``hold_s`` has K entries, ``move_s`` K-1."""
        self._postures = postures
        self._names = tuple(names)
        self._arrive = np.concatenate([[0.0], np.cumsum(np.array(hold_s[:-1]) + np.array(move_s))])
        self._leave = self._arrive + np.array(hold_s)
        self._move = np.append(np.array(move_s), 1.0)
        self._late = random.uniform(0.0, 0.2, (len(postures), len(DRIVEN)))

    @property
    def duration_s(self) -> float:
        return float(self._leave[-1])

    def driven(self, time_s: np.ndarray) -> np.ndarray:
        at = self._index(time_s)
        after = np.minimum(at + 1, len(self._postures) - 1)
        share = ((time_s - self._leave[at]) / self._move[at])[:, None]
        progress = minimum_jerk((share - self._late[at]) / (1 - self._late[at]))
        return self._postures[at] + progress * (self._postures[after] - self._postures[at])

    def poses(self, time_s: np.ndarray) -> tuple[str, ...]:
        at = self._index(time_s)
        held = time_s <= self._leave[at]
        return tuple(self._names[i] if still else "" for i, still in zip(at, held, strict=True))

    def _index(self, time_s: np.ndarray) -> np.ndarray:
        return np.clip(np.searchsorted(self._arrive, time_s, side="right") - 1, 0, len(self._arrive) - 1)


@dataclass(frozen=True)
class Sweep:
    """From a start posture into swings of several joints at different speeds, and back."""

    start: np.ndarray
    """Posture at both ends, shape (len(DRIVEN),), degrees."""
    low: np.ndarray
    high: np.ndarray
    """Each joint swings between these; equal where it is held, for instance by a widget."""
    speed_hz: np.ndarray
    phase: np.ndarray
    duration_s: float
    blend_s: float = 0.4
    slowest_share: float = 1.0
    """Of their speed, at which swings begin and to which they slow down again in each ``PACE_S``."""

    def driven(self, time_s: np.ndarray) -> np.ndarray:
        """Shape (N, len(DRIVEN)), degrees."""
        middle, turn = (1 + self.slowest_share) / 2, 2 * np.pi / PACE_S
        gone_s = middle * time_s - (1 - middle) * np.sin(turn * time_s) / turn
        angle = 2 * np.pi * self.speed_hz * gone_s[:, None] + self.phase
        swing = self.low + (self.high - self.low) * (1 - np.cos(angle)) / 2
        share = np.minimum(time_s, self.duration_s - time_s) / self.blend_s
        return self.start + minimum_jerk(share)[:, None] * (swing - self.start)

    def poses(self, time_s: np.ndarray) -> tuple[str, ...]:
        return ("",) * len(time_s)


class Unrest:
    """Slow wander and tremor of each joint, added to any motion."""

    def __init__(self, random: np.random.Generator, held: Sequence[str] = ()) -> None:
        """``held`` joints are clamped by a widget and do not move at all."""
        shape = (5, len(DRIVEN))
        slow = np.arange(5)[:, None] < 2
        self._speed_hz = np.where(slow, random.uniform(0.1, 0.5, shape), random.uniform(7.0, 11.0, shape))
        free = np.array([name not in held for name in DRIVEN])
        self._size = np.where(slow, WANDER_DEG, TREMOR_DEG) * random.uniform(0.5, 1.5, shape) * free
        self._phase = random.uniform(0, 2 * np.pi, shape)

    def driven(self, time_s: np.ndarray) -> np.ndarray:
        """Shape (N, len(DRIVEN)), degrees."""
        waves = np.sin(2 * np.pi * self._speed_hz * time_s[:, None, None] + self._phase)
        return (self._size * waves).sum(axis=1)


NAMED_SHARE = 0.35
"""How often a posture lies between two named ones instead of being made of synergies."""

LONGEST_STEP_S = 0.9
RETURN_S = 0.5


def free_motion(duration_s: float, random: np.random.Generator) -> PostureSequence:
    """Random postures for ``duration_s``, starting and ending at rest."""
    rest = posture_vector(POSTURES["rest"])
    postures, hold, move = [rest], [0.1], []
    while sum(hold) + sum(move) + LONGEST_STEP_S + RETURN_S < duration_s:
        postures.append(random_posture(random))
        move.append(random.uniform(0.25, LONGEST_STEP_S - 0.3))
        hold.append(random.choice([0.0, 0.0, 0.1, 0.3]))
    postures.append(rest)
    move.append(RETURN_S)
    hold.append(max(duration_s - sum(hold) - sum(move), 0.0))
    return PostureSequence(np.array(postures), [""] * len(postures), hold_s=hold, move_s=move, random=random)


def random_posture(random: np.random.Generator) -> np.ndarray:
    """One posture within the active ranges, shape (len(DRIVEN),), degrees."""
    if random.random() < NAMED_SHARE:
        first, second = random.choice(TABLE_3_POSES, 2)
        mix = random.random()
        between = mix * posture_vector(POSTURES[first]) + (1 - mix) * posture_vector(POSTURES[second])
        return within_range(between + 4 * random.standard_normal(len(DRIVEN)))
    return within_range(posture_vector(_from_synergies(random)))


def _from_synergies(random: np.random.Generator) -> dict[str, float]:
    close, hook, oppose = random.uniform(-0.1, 1), random.uniform(-0.4, 0.4), random.uniform(0, 1)
    posture = {}
    for finger in LONG_FINGERS:
        own = 0.2 * random.standard_normal()
        posture[f"{finger}_MCP"] = 90 * (close + own - hook)
        posture[f"{finger}_PIP"] = 100 * (close + own + hook)
    spread = random.uniform(0, 1) * (1 - 0.7 * max(close, 0))
    for pair in ("IM_ABD", "MR_ABD", "RP_ABD"):
        posture[pair] = 30 * spread + 3 * random.standard_normal()
    posture["T_TMC"] = 60 * oppose + 6 * random.standard_normal()
    posture["TI_ABD"] = 70 * random.uniform(0, 1) * (1 - 0.4 * close)
    posture["T_MCP"] = 50 * (0.6 * oppose + 0.4 * random.random())
    posture["T_IP"] = 80 * (0.5 * close + 0.5 * random.random())
    posture["W_FLEX"] = 25 - 50 * close + 20 * random.standard_normal()  # a closing hand extends the wrist
    posture["W_ABD"] = -4 + 10 * random.standard_normal()
    return posture


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
    swings = {f"{finger}_MCP": (-5.0, 90.0) for finger in LONG_FINGERS}
    swings |= {f"{finger}_PIP": (0.0, 100.0) for finger in LONG_FINGERS}
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
