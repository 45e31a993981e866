"""A moving hand: natural configurations one after another, the palm turning and drifting before a camera.

For what has to be learned or measured on sequences: how far a hand moves from one picture to the next, how
errors last. Generated, as the poses are.
"""

from __future__ import annotations

import numpy as np

from glovecal_models.colour_glove.database import orientations, palm_centre
from glovecal_models.colour_glove.hand_state import HandState
from glovecal_models.colour_glove.pose_set import generated_poses
from glovecal_models.colour_glove.skin import HandSkin
from glovecal_models.errors import BadInput

HOLD_S, CHANGE_S = (0.1, 0.6), (0.35, 0.9)
"""How long a configuration is held, how long the way to the next takes."""
TURN_S, WANDER_S = (1.0, 2.5), (1.0, 2.5)
NEAREST_MM, FARTHEST_MM = 350.0, 600.0
ASIDE = (0.25, 0.18)
"""Of the distance: how far the palm goes from the camera's axis, across and down."""
CONE_DEG = 60.0


def hand_motion(
    skin: HandSkin, seconds: float, rate_hz: float = 30.0, *, seed: int, cone_deg: float = CONE_DEG
) -> list[HandState]:
    """States at 0, 1 / rate, ... before ``seconds``. Raises BadInput unless length and rate are above 0."""
    if not (seconds > 0 and rate_hz > 0):
        raise BadInput(f"a motion of {seconds} s at {rate_hz} Hz; both must be above 0")
    from scipy.spatial.transform import Rotation, Slerp

    rng = np.random.default_rng([seed, 14])
    times = np.arange(0.0, seconds, 1.0 / rate_hz)
    angles = _held_and_changed(rng, times, generated_poses(int(seconds / 0.3) + 4, seed=seed))
    stations = _stations(rng, seconds, TURN_S)
    turns = Rotation.from_matrix(orientations(len(stations), cone_deg, rng))
    # A turn of half a circle within a second is more than an arm does.
    turns = Rotation.concatenate([turns[0], *_limited(turns)])
    rotations = Slerp(stations, turns)(_eased(times, stations)).as_matrix()
    stops = _stations(rng, seconds, WANDER_S)
    depth = rng.uniform(NEAREST_MM, FARTHEST_MM, len(stops))
    aside = rng.uniform(-1.0, 1.0, (len(stops), 2)) * ASIDE * depth[:, None]
    way = _eased(times, stops)
    where = np.column_stack([np.interp(way, stops, axis) for axis in (*aside.T, depth)])
    centre = palm_centre(skin)
    return [
        HandState(bend, turn, place - turn @ centre)
        for bend, turn, place in zip(angles, rotations, where, strict=True)
    ]


def _limited(turns):  # type: ignore[no-untyped-def]
    """Each next orientation at most 60 degrees from the one before."""
    found, last = [], turns[0]
    for turn in turns[1:]:
        step = turn * last.inv()
        angle = step.magnitude()
        share = min(1.0, np.radians(60.0) / max(angle, 1e-9))
        last = type(step).from_rotvec(share * step.as_rotvec()) * last
        found.append(last)
    return found


def _stations(rng: np.random.Generator, seconds: float, apart_s: tuple[float, float]) -> np.ndarray:
    found = [0.0]
    while found[-1] <= seconds:
        found.append(found[-1] + rng.uniform(*apart_s))
    return np.array(found)


def _eased(times: np.ndarray, stations: np.ndarray) -> np.ndarray:
    """The same times, slow at each station."""
    segment = np.clip(np.searchsorted(stations, times, side="right") - 1, 0, len(stations) - 2)
    low, high = stations[segment], stations[segment + 1]
    share = (times - low) / (high - low)
    return low + (high - low) * share * share * (3.0 - 2.0 * share)


def _held_and_changed(rng: np.random.Generator, times: np.ndarray, poses: np.ndarray) -> np.ndarray:
    """(N, 20): from pose to pose by minimum jerk, each held for a while."""
    found = np.empty((len(times), poses.shape[1]))
    begin, index = 0.0, 0
    while True:
        hold, change = rng.uniform(*HOLD_S), rng.uniform(*CHANGE_S)
        here, there = poses[index % len(poses)], poses[(index + 1) % len(poses)]
        share = np.clip((times - begin - hold) / change, 0.0, 1.0)
        share = share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
        now = times >= begin
        found[now] = here + share[now, None] * (there - here)
        begin += hold + change
        index += 1
        if begin > times[-1]:
            return found
