"""What really happens during several takes at once, before any sensor: hand, clock, power, battery, air.

All takes of a scene share one grid of times, which begins before the first frame (what the hand did then is
never recorded, but sensors remember it) and ends after the last (a clock may be off by that much).

How the hand moves in each take of a simulated session, and before it.

Natural motion takes the postures of ``free_motion`` at the pace of everyday use (near 40 degrees a second
RMS, with holds). The others are takes made to tell causes apart: swings that get fast and slow again, ramps
at two speeds with inner loops and holds, one finger at a time, a palm that is cupped while the fingers keep
still, repeated poses, a hand that lies still.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from glovecal_models.hand.rotations import ACTIVE_RANGE_DEG
from glovecal_models.simulation.protocol import (
    HandMotion,
    PostureSequence,
    Segment,
    Sweep,
    Unrest,
    posture_vector,
    random_posture,
    within_range,
)
from glovecal_models.simulation.session_plan import VOLTS_PER_HOUR, Air, SessionPlan, TakeMotion, TakeStart
from glovecal_models.simulation.simulated_glove import BRIDGE_S, Performance
from glovecal_models.simulation.simulated_hand import (
    DRIVEN,
    LONG_FINGERS,
    POSTURES,
    ROTATIONS,
    TABLE_3_POSES,
    SimulatedHand,
    bent_share,
)

MOVE_S = (0.7, 1.6)
HOLD_S = (0.0, 0.0, 0.3, 0.8, 1.6)
"""Free motion (``free_motion``) is made for short lively takes; in long ones hands go slower and wait."""
FAST_HZ = (2.0, 3.5)
FAST_DEG = 25.0
FAST_SLOWEST = 0.2
"""Of that speed, with which swings begin and to which they slow down: while it stays the same, a gain looks
like a filter."""
RAMP_SPEED_RATIO = 3.0
_RAMP_CORNERS = (0.05, 0.95, 0.3, 0.75, 0.2, 0.95, 0.05)
"""Shares of the range between which ramps run: a full loop with two inner loops."""
_STAND_INS = ("I_MCP", "M_PIP", "R_MCP", "P_PIP", "I_PIP", "M_MCP", "R_PIP", "P_MCP", "T_IP", "W_FLEX")
BEFORE_S = 61.0
AFTER_S = 3.0
PRE_ROLL_S = (20.0, 60.0)
"""How long the hand moved or rested in the glove before recording began."""
PALM_OF_ITS_OWN_DEG = 3.0
"""How far a person cups the palm beyond what thumb and outer fingers ask for."""
CUPPED_ON_PURPOSE_DEG = 10.0


@dataclass(frozen=True)
class Ramps:
    """Straight movement between postures at given times."""

    at_s: np.ndarray
    """Shape (K,), increasing from 0."""
    postures: np.ndarray
    """Shape (K, len(DRIVEN)), degrees."""

    @property
    def duration_s(self) -> float:
        return float(self.at_s[-1])

    def driven(self, time_s: np.ndarray) -> np.ndarray:
        return np.column_stack([np.interp(time_s, self.at_s, column) for column in self.postures.T])

    def poses(self, time_s: np.ndarray) -> tuple[str, ...]:
        return ("",) * len(time_s)


def take_segment(motion: TakeMotion, duration_s: float, random: np.random.Generator) -> Segment:
    """One take's motion, lasting ``duration_s``."""
    if motion == "still":
        return rest_segment(duration_s, random)
    makers = {
        "natural": _natural,
        "fast": _fast,
        "ramps": _ramps,
        "holds": _holds,
        "one_finger": _one_finger,
        "palm": _still_fingers,
        "poses": _poses,
    }
    return Segment(motion, makers[motion](duration_s, random), Unrest(random))


def rest_segment(duration_s: float, random: np.random.Generator) -> Segment:
    """A hand lying on a table: nothing moves."""
    posture = within_range(posture_vector(POSTURES["rest"]) + 3 * random.standard_normal(len(DRIVEN)))
    return Segment("still", _hold(posture, duration_s, random), Unrest(random, held=DRIVEN))


def joints(rotations: Sequence[str]) -> tuple[str, ...]:
    """Which joint of the simulated hand plays each rotation; names that are not a hand's get stand-ins."""
    free = [name for name in _STAND_INS if name not in rotations] * len(rotations)
    chosen = iter(free or ROTATIONS)
    return tuple(name if name in ROTATIONS else next(chosen) for name in rotations)


def _hold(posture: np.ndarray, duration_s: float, random: np.random.Generator) -> PostureSequence:
    return PostureSequence(posture[None], [""], hold_s=[duration_s], move_s=[], random=random)


def _natural(duration_s: float, random: np.random.Generator) -> HandMotion:
    rest = posture_vector(POSTURES["rest"])
    postures, hold, move = [rest], [random.uniform(0.1, 0.6)], []
    while sum(hold) + sum(move) + MOVE_S[1] + HOLD_S[-1] + 1.0 < duration_s:
        postures.append(random_posture(random))
        move.append(random.uniform(*MOVE_S))
        hold.append(float(random.choice(HOLD_S)) * random.uniform(0.7, 1.3))
    postures.append(rest)
    move.append(1.0)
    hold.append(max(duration_s - sum(hold) - sum(move), 0.0))
    return PostureSequence(np.array(postures), [""] * len(postures), hold_s=hold, move_s=move, random=random)


def _fast(duration_s: float, random: np.random.Generator) -> HandMotion:
    middle = posture_vector(POSTURES["rest"]) + 10
    low, high = middle.copy(), middle.copy()
    speed = np.zeros(len(DRIVEN))
    for name in (f"{finger}_{joint}" for finger in LONG_FINGERS for joint in ("MCP", "PIP")):
        column = DRIVEN.index(name)
        amplitude = FAST_DEG * random.uniform(0.8, 1.2)
        low[column], high[column] = middle[column] - amplitude, middle[column] + amplitude
        speed[column] = random.uniform(*FAST_HZ)
    phase = random.uniform(0, 2 * np.pi, len(DRIVEN))
    return Sweep(
        middle, within_range(low), within_range(high), speed, phase, duration_s, slowest_share=FAST_SLOWEST
    )


def _ramps(duration_s: float, random: np.random.Generator) -> HandMotion:
    holding = 20.0 if duration_s >= 36 else 0.45 * duration_s
    low, high = np.array([ACTIVE_RANGE_DEG[name] for name in DRIVEN]).T
    still = np.array([name.startswith("W_") or name.endswith("ABD") for name in DRIVEN])
    rest = posture_vector(POSTURES["rest"])

    def at(share: float) -> np.ndarray:
        return np.where(still, rest, low + (share * random.uniform(0.93, 1.0)) * (high - low))

    corners = [at(share) for share in (*_RAMP_CORNERS, *_RAMP_CORNERS)]
    travel = np.abs(np.diff([*_RAMP_CORNERS, *_RAMP_CORNERS])) + 0.02
    travel[len(_RAMP_CORNERS) :] /= RAMP_SPEED_RATIO
    seconds = travel * (duration_s - holding - 1.5) / travel.sum()
    high_hold, low_hold = at(0.7), at(0.25)
    postures = [*corners, high_hold, high_hold, low_hold, low_hold]
    steps = [*seconds, 1.0, holding / 2, 0.5, holding / 2]
    return Ramps(np.concatenate([[0.0], np.cumsum(steps)]), np.array(postures))


def _holds(duration_s: float, random: np.random.Generator) -> HandMotion:
    count = max(int(duration_s / 5.0), 2)
    hold = random.uniform(3.0, 5.0, count)
    move = np.full(count - 1, 0.7)
    hold *= (duration_s - move.sum()) / hold.sum()
    postures = np.array([random_posture(random) for _ in range(count)])
    return PostureSequence(postures, [""] * count, hold_s=list(hold), move_s=list(move), random=random)


def _one_finger(duration_s: float, random: np.random.Generator) -> HandMotion:
    rest = posture_vector(POSTURES["flat"])
    groups = [tuple(f"{finger}_{joint}" for joint in ("MCP", "PIP")) for finger in LONG_FINGERS]
    groups.append(("T_TMC", "TI_ABD", "T_MCP", "T_IP"))
    bends = max(int(duration_s / len(groups) / 2.0), 1)
    postures = [rest]
    for group in groups:
        for _ in range(bends):
            bent = rest.copy()
            for name in group:
                low, high = ACTIVE_RANGE_DEG[name]
                bent[DRIVEN.index(name)] = low + random.uniform(0.5, 1.0) * (high - low)
            postures += [bent, rest]
    move = (duration_s - 1.0) / (len(postures) - 1)
    return PostureSequence(
        np.array(postures),
        [""] * len(postures),
        hold_s=[0.5, *[0.0] * (len(postures) - 2), 0.5],
        move_s=[move] * (len(postures) - 1),
        random=random,
    )


def _still_fingers(duration_s: float, random: np.random.Generator) -> HandMotion:
    """Flat, half bent, and with the thumb across; the palm is cupped in each of them."""
    flat, bent = posture_vector(POSTURES["flat"]), posture_vector(POSTURES["rest"]) + 10
    across = flat.copy()
    across[DRIVEN.index("T_TMC")] = ACTIVE_RANGE_DEG["T_TMC"][1]
    return PostureSequence(
        within_range(np.array([flat, bent, across])),
        [""] * 3,
        hold_s=[(duration_s - 2.0) / 3] * 3,
        move_s=[1.0] * 2,
        random=random,
    )


def _poses(duration_s: float, random: np.random.Generator) -> HandMotion:
    count = max(int(duration_s / 2.0), 2)
    names = [TABLE_3_POSES[place % 5] for place in range(count)]
    exact = np.array([posture_vector(POSTURES[name]) for name in names])
    postures = within_range(exact + 2.0 * random.standard_normal(exact.shape))
    hold = (duration_s - 0.7 * (count - 1)) / count
    return PostureSequence(postures, names, hold_s=[hold] * count, move_s=[0.7] * (count - 1), random=random)


@dataclass(frozen=True)
class Scene:
    """Arrays have shape (T, N) or (T, N, channels): takes, times, and one per sensor unless told."""

    starts: tuple[TakeStart, ...]
    rate_hz: float
    time_s: np.ndarray
    """Shape (N,), seconds from each take's first frame, negative before it."""
    recorded: slice
    """The part of the grid that becomes frames."""
    hand: np.ndarray
    """Every rotation of the simulated hand (``ROTATIONS``), shape (T, N, 23), degrees."""
    angles: np.ndarray
    """The plan's rotations, shape (T, N, R), degrees."""
    own: np.ndarray
    """Each sensor's own rotation, shape (T, N, S), degrees."""
    low: np.ndarray
    """Shape (S,): lowest angle of each sensor's own rotation, degrees."""
    high: np.ndarray
    counts_zero_deg: np.ndarray
    """Shape (S,): counts at 0 degrees over counts per degree; the voltage behind a reading is in proportion
    to this plus the signal."""
    sensors: tuple[str, ...]
    poses: tuple[tuple[str, ...], ...]
    session_s: np.ndarray
    power_on_s: np.ndarray
    since_donned_s: np.ndarray
    supply_v: np.ndarray
    temperature_c: np.ndarray
    humidity_pct: np.ndarray
    usual_air: tuple[float, float]
    """Temperature and humidity about which this session's air moves."""

    @property
    def span(self) -> np.ndarray:
        """Shape (S,): the size of each sensor's range, degrees."""
        return self.high - self.low

    def rotation(self, name: str) -> np.ndarray:
        """One rotation of the whole hand, measured or not, shape (T, N), degrees."""
        return self.hand[:, :, ROTATIONS.index(name)]

    def bent(self, name: str) -> np.ndarray:
        """The same as a share 0..1 of its range."""
        return bent_share(name, self.rotation(name))

    @cached_property
    def closing(self) -> np.ndarray:
        """How far the hand is closed, 0..1, shape (T, N): the mean bend of eight finger joints."""
        names = [f"{finger}_{joint}" for finger in "IMRP" for joint in ("MCP", "PIP")]
        return np.mean([self.bent(name) for name in names], axis=0)


def play_scene(plan: SessionPlan, starts: Sequence[TakeStart], counts_zero_deg: np.ndarray) -> Scene:
    """Let the hand perform all takes of ``starts``, which last equally long."""
    take_s = starts[0].take_s
    before, frames = round(BEFORE_S * plan.rate_hz), round(take_s * plan.rate_hz)
    time = np.arange(-before, frames + round(AFTER_S * plan.rate_hz)) / plan.rate_hz
    recorded = slice(before, before + frames)
    performed = [_perform(plan, start, time) for start in starts]
    hand = np.stack([angles for angles, _ in performed])
    played_by = joints(plan.rotations)
    angles = hand[:, :, [ROTATIONS.index(name) for name in played_by]]
    own = list(plan.own_rotations)
    low, high = np.array([ACTIVE_RANGE_DEG[played_by[place]] for place in own]).T
    now = np.array([start.session_s for start in starts])[:, None] + time
    donned = np.array([start.since_donned_s for start in starts])[:, None] + time
    supply = np.array([start.supply_v for start in starts])[:, None] - VOLTS_PER_HOUR * time / 3600
    air = Air(plan)
    temperature, humidity = air.temperature_c(now, donned), air.humidity_pct(now, donned)
    for number, start in enumerate(starts):
        if start.air is not None:
            changed = start.air.felt(temperature[number], humidity[number], time)
            temperature[number], humidity[number] = changed
    return Scene(
        starts=tuple(starts),
        rate_hz=plan.rate_hz,
        time_s=time,
        recorded=recorded,
        hand=hand,
        angles=angles,
        own=angles[:, :, own],
        low=low,
        high=high,
        counts_zero_deg=counts_zero_deg,
        sensors=plan.sensors,
        poses=tuple(names[recorded] for _, names in performed),
        session_s=now,
        power_on_s=np.array([start.power_on_s for start in starts])[:, None] + time,
        since_donned_s=donned,
        supply_v=supply,
        temperature_c=temperature,
        humidity_pct=humidity,
        usual_air=air.usual,
    )


def _perform(plan: SessionPlan, start: TakeStart, time: np.ndarray) -> tuple[np.ndarray, tuple[str, ...]]:
    """The whole hand, shape (N, 23) degrees, and poses in one take and before it."""
    random = np.random.default_rng([plan.seed, 43, start.key])
    pre_roll_s = random.uniform(*PRE_ROLL_S)
    resting = random.random() < 0.3
    waiting = pre_roll_s - BRIDGE_S
    first = rest_segment(waiting, random) if resting else take_segment("natural", waiting, random)
    performance = Performance(
        SimulatedHand(plan.seed),
        [Segment("", first.motion, first.unrest), take_segment(start.motion, start.take_s + AFTER_S, random)],
        ROTATIONS,
    )
    hand, poses = performance.at(np.maximum(time + pre_roll_s, 0.0))
    swell = np.sin(2 * np.pi * time / random.uniform(4.0, 9.0) + random.uniform(0, 2 * np.pi))
    palm = ROTATIONS.index("PALM_ARCH")
    if start.motion != "still":
        cupped_deg = CUPPED_ON_PURPOSE_DEG if start.motion == "palm" else PALM_OF_ITS_OWN_DEG
        hand[:, palm] = np.maximum(hand[:, palm] + cupped_deg * swell, 0.0)
    return hand, poses if start.motion == "poses" else ("",) * len(poses)
