"""Clock offset: the reference's times differ from the glove's.

By a crystal that follows the air, a correction at one moment, or a solver that is slow for a closed hand.
"""

from __future__ import annotations

import numpy as np
from scipy.signal import lfilter

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene
from glovecal_models.simulation.signals import at_times


@form(
    Stage.CLOCK,
    "A tuning-fork crystal loses time by the square of its distance from about 25 degC (data sheets of 32 kHz).",
    set_aside=True,
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
    set_aside=True,
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
    set_aside=True,
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


FORMS = (tuning_fork_crystal, stepped_once, slow_for_closed_hand)
