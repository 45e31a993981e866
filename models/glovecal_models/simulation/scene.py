"""What really happens during several takes at once, before any sensor: hand, clock, power, battery, air.

All takes of a scene share one grid of times, which begins before the first frame (what the hand did then is
never recorded, but sensors remember it) and ends after the last (a clock may be off by that much).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from glovecal_models.hand_ranges import ACTIVE_RANGE_DEG
from glovecal_models.simulation.protocol import Segment
from glovecal_models.simulation.session_motion import joints, rest_segment, take_segment
from glovecal_models.simulation.session_plan import SessionPlan
from glovecal_models.simulation.session_schedule import VOLTS_PER_HOUR, Air, TakeStart
from glovecal_models.simulation.simulated_hand import ROTATIONS, SimulatedHand
from glovecal_models.simulation.simulated_take import BRIDGE_S, Performance
from glovecal_models.simulation.stretch import bent_share

BEFORE_S = 61.0
AFTER_S = 3.0
PRE_ROLL_S = (20.0, 60.0)
"""How long the hand moved or rested in the glove before recording began."""
PALM_OF_ITS_OWN_DEG = 3.0
"""How far a person cups the palm beyond what thumb and outer fingers ask for."""
CUPPED_ON_PURPOSE_DEG = 10.0


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
        temperature_c=air.temperature_c(now, donned),
        humidity_pct=air.humidity_pct(now, donned),
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
