"""Clock offset: the reference's times are wrong, so that its angles belong to other moments than stamped.

The glove is right in all of these: only the reference is read at other times, all its rotations alike.

Times counted from frame numbers, two time servers, a crystal that settles: all concern the reference alone.

By a crystal that follows the air, a correction at one moment, or a solver that is slow for a closed hand.
"""

from __future__ import annotations

import numpy as np
from scipy.signal import lfilter

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene
from glovecal_models.simulation.signals import at_times

SIZES = (0.002, 1.2)


LONGEST_S = 20000.0


@form(
    Stage.CLOCK,
    "Times counted in frames at the nominal rate while the true one differs, from nought in every take"
    " (drop-frame timecode).",
    only_by_name=True,
    sizes=SIZES,
    shared=True,
)
def counted_at_nominal_rate(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The difference is nought at the start signal and grows evenly until the take ends, every time anew."""
    take_s = (scene.recorded.stop - scene.recorded.start) / scene.rate_hz
    off = draws.sign() * 1.6 * np.clip(scene.time_s / take_s, 0.0, 1.1)
    return _read_late(signal, scene, float(size.max()) * np.tile(off, (len(scene.starts), 1)))


@form(
    Stage.CLOCK,
    "Cameras lose frames now and then and number the rest on: the time difference grows in steps (ours).",
    only_by_name=True,
    sizes=SIZES,
    shared=True,
)
def lost_frames_not_counted(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A staircase over the session: a step wherever frames were lost, and none is ever made good."""
    every = draws.one("every_s", 40.0, 110.0)
    gaps = draws.stream("gaps").exponential(every, round(LONGEST_S / every))
    steps = np.searchsorted(np.cumsum(gaps), scene.session_s)
    # What matters is the difference since the clocks were set, some steps before the first take.
    off = draws.sign() * (1.0 + steps) / 6.0
    return _read_late(signal, scene, float(size.max()) * np.minimum(off, 2.0))


@form(
    Stage.CLOCK,
    "The reference's computer changes to and fro between two time servers that disagree (network time).",
    only_by_name=True,
    sizes=SIZES,
    shared=True,
)
def two_time_servers(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """One of two time differences at any moment, each for a while; neither of the servers is right."""
    stay = draws.one("stay_s", 8.0, 40.0)
    changes = np.cumsum(draws.stream("stays").exponential(stay, round(LONGEST_S / stay)))
    second = np.searchsorted(changes, scene.session_s) % 2
    other = draws.one("other", -0.6, 0.4)
    return _read_late(signal, scene, float(size.max()) * draws.sign() * np.where(second, other, 1.0))


def _read_late(signal: np.ndarray, scene: Scene, off_s: np.ndarray) -> np.ndarray:
    """The reference read at times moved by ``off_s`` (T, N) seconds."""
    moved = [at_times(scene.time_s, one, scene.time_s - off) for one, off in zip(signal, off_s, strict=True)]
    return np.stack(moved)


@form(
    Stage.CLOCK,
    "Times counted from frame numbers at a wrong rate: a ramp from each take's first frame.",
    only_by_name=True,
    sizes=(0.002, 1.2),
    shared=True,
)
def counted_frames(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The time difference is nothing at a take's start and grows evenly until its end."""
    take_s = np.array([start.take_s for start in scene.starts])[:, None]
    return _read(signal, scene, size[0] * draws.sign() * scene.time_s / take_s)


@form(
    Stage.CLOCK,
    "The reference's computer listens to two time servers in turn, which disagree (network time; ours).",
    only_by_name=True,
    sizes=(0.002, 1.2),
    shared=True,
)
def two_servers(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The time difference changes to and fro between two values at random moments."""
    other = draws.one("other", -0.4, 0.3)
    stays_s = draws.one("stays_s", 12.0, 40.0)
    offset = np.empty((len(scene.starts), len(scene.time_s)))
    for row, start in enumerate(scene.starts):
        random = draws.stream("switches", start.key)
        moments = np.cumsum(random.exponential(stays_s, 60)) + scene.time_s[0]
        turn = np.searchsorted(moments, scene.time_s) + random.integers(2)
        offset[row] = np.where(turn % 2 == 0, 1.0, other)
    return _read(signal, scene, size[0] * draws.sign() * offset)


@form(
    Stage.CLOCK,
    "A crystal settles: the difference gained levels off over the session (ours).",
    only_by_name=True,
    sizes=(0.002, 1.2),
    shared=True,
)
def settling_crystal(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The reference's clock gains or loses at a rate that dies away."""
    settles_s = draws.one("settles_s", 200.0, 900.0)
    offset = -np.expm1(-np.maximum(scene.session_s, 0) / settles_s)
    return _read(signal, scene, size[0] * draws.sign() * offset)


def _read(signal: np.ndarray, scene: Scene, offset_s: np.ndarray) -> np.ndarray:
    """The reference read ``offset_s`` (T, N) earlier."""
    times = scene.time_s - offset_s
    return np.stack([at_times(scene.time_s, take, now) for take, now in zip(signal, times, strict=True)])


@form(
    Stage.CLOCK,
    "A tuning-fork crystal loses time by the square of its distance from about 25 degC"
    " (data sheets of 32 kHz).",
    only_by_name=True,
    sizes=(0.002, 1.2),
    shared=True,
)
def tuning_fork_crystal(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The time lost adds up through the session, more the further the air is from the turnover point."""
    turnover = draws.one("turnover_c", 20.0, 30.0)
    middle = scene.session_s.mean(axis=1)
    order = np.argsort(middle)
    rate = (scene.temperature_c.mean(axis=1)[order] - turnover) ** 2 + 1.0
    knots = np.r_[np.minimum(scene.session_s.min(), 0.0), middle[order], scene.session_s.max()]
    rates = np.r_[rate[0], rate, rate[-1]]
    lost = np.r_[0.0, np.cumsum(np.diff(knots) * (rates[1:] + rates[:-1]) / 2)]
    offset = draws.sign() * size[0] * np.interp(scene.session_s, knots, lost) / 15000
    return _shifted(signal, scene, offset)


@form(
    Stage.CLOCK,
    "A network clock is off by too much to be slewed and is set right at one moment (NTP's step threshold).",
    only_by_name=True,
    sizes=(0.002, 1.2),
    shared=True,
)
def stepped_once(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """One time difference up to a moment of the session, a small one of the other sign from then on."""
    moment = draws.one("moment_s", 600.0, 1500.0)
    after = draws.one("after", -0.4, -0.1)
    offset = draws.sign() * size[0] * np.where(scene.session_s < moment, 1.2, after)
    return _shifted(signal, scene, offset)


@form(
    Stage.CLOCK,
    "Solving takes longer while a closed hand hides its markers, and poses are stamped when solved (ours).",
    only_by_name=True,
    sizes=(0.002, 1.2),
    shared=True,
)
def slow_for_closed_hand(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The time difference follows, a little smoothed, how far the hand is closed."""
    keep = np.exp(-1 / (draws.one("smooth_s", 1.5, 3.0) * scene.rate_hz))
    closed = scene.closing - scene.closing[:, :1]
    smooth = np.asarray(lfilter([1 - keep], [1.0, -keep], closed, axis=1)) + scene.closing[:, :1]
    return _shifted(signal, scene, draws.sign() * size[0] * (0.2 + 1.6 * smooth))


def _shifted(signal: np.ndarray, scene: Scene, offset_s: np.ndarray) -> np.ndarray:
    """The signal at its times plus an offset for every take and time."""
    moved = zip(signal, scene.time_s + offset_s, strict=True)
    return np.stack([at_times(scene.time_s, take, times) for take, times in moved])


FORMS = (
    counted_at_nominal_rate,
    lost_frames_not_counted,
    two_time_servers,
    counted_frames,
    two_servers,
    settling_crystal,
    tuning_fork_crystal,
    stepped_once,
    slow_for_closed_hand,
)
