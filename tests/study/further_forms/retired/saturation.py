"""Saturation: beyond some bend readings hardly change, so that they no longer tell angles apart.

How the limit is reached differs: a power stage limits both ways with a rounded knee, a clamping diode lets
the logarithm through, and an average of clipped noisy samples blurs the corner.

An amplifier turns its output over, a push-pull stage is dead about its middle, and a diode clamps.

Steps may grow with the signal, the window may follow the mean, or the current may be shared.
"""

from __future__ import annotations

import numpy as np
from scipy.special import ndtr

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene

SIZES = (0.02, 1.6)


@form(
    Stage.COUNTS,
    "An output stage that limits alike at both ends, with a rounded knee (Rapp 1991).",
    only_by_name=True,
    sizes=SIZES,
    touches="two",
    judged_by="lost_angle",
)
def rapp_limiter(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A straight line about mid-range that turns into a limit above and below."""
    knee = draws.each("knee", 5.0, 9.0)
    from_middle = (signal - scene.low) / scene.span * 2 - 1
    limited = from_middle / (1 + np.abs(1.5 * size * from_middle) ** knee) ** (1 / knee)
    return signal + 0.5 * scene.span * (limited - from_middle)


@form(
    Stage.COUNTS,
    "A diode across the amplifier's input conducts beyond its knee and lets the logarithm through"
    " (clamping diode).",
    only_by_name=True,
    sizes=SIZES,
    touches="two",
    judged_by="lost_angle",
)
def diode_across_input(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Past the knee, at one end drawn per sensor, only the logarithm of what is beyond gets through."""
    folds = draws.each("e_fold_deg", 0.3, 0.8)
    end = draws.signs("end")
    beyond = np.maximum(_beyond(signal, scene, size, end), 0.0)
    return signal - end * (beyond - folds * np.log1p(beyond / folds))


@form(
    Stage.COUNTS,
    "Many noisy samples are clipped one by one before their mean is sent: a blurred corner"
    " (oversampling converter).",
    only_by_name=True,
    sizes=SIZES,
    touches="two",
    judged_by="lost_angle",
)
def clipped_before_mean(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The mean of a clipped Gaussian, at one end drawn per sensor."""
    noise = draws.each("noise_deg", 2.0, 5.0)
    end = draws.signs("end")
    beyond = _beyond(signal, scene, size, end)
    bell = np.exp(-0.5 * np.square(beyond / noise)) / np.sqrt(2 * np.pi)
    return signal - end * (beyond * ndtr(beyond / noise) + noise * bell)


def _beyond(signal: np.ndarray, scene: Scene, size: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Degrees beyond a limit that moves in from the high (1) or low (-1) end as ``size`` grows."""
    from_middle = end * (signal - scene.low - 0.5 * scene.span)
    return from_middle - (0.6 - 0.6 * size) * scene.span


@form(
    Stage.COUNTS,
    "Beyond its input range an amplifier's output turns back (phase reversal of older amplifiers).",
    only_by_name=True,
    touches="two",
    judged_by="lost_angle",
    sizes=(0.02, 1.6),
)
def phase_reversal(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Readings stop at an edge and come down again by part of what exceeds it."""
    edge = scene.high - size * scene.span
    over = np.maximum(signal - edge, 0)
    return np.minimum(signal, edge) - draws.each("turned", 0.05, 0.2) * over


@form(
    Stage.COUNTS,
    "A push-pull stage is dead about its middle, where neither half conducts (crossover distortion).",
    only_by_name=True,
    touches="two",
    judged_by="lost_angle",
    sizes=(0.02, 1.6),
)
def crossover(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Nothing changes within a band about mid-range; outside the band's width is missing."""
    away = signal - scene.low - draws.each("middle", 0.38, 0.5) * scene.span
    half = size * scene.span / 2
    return signal - np.clip(away, -half, half)


@form(
    Stage.COUNTS,
    "A protection diode takes over above its knee, and readings rise with the logarithm (Shockley 1949).",
    only_by_name=True,
    touches="two",
    judged_by="lost_angle",
    sizes=(0.02, 1.6),
)
def clamping_diode(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Straight up to the knee, a logarithm of what exceeds it above."""
    knee = scene.high - size * scene.span
    scale = draws.each("scale_deg", 0.4, 1.5)
    over = np.maximum(signal - knee, 0)
    return np.minimum(signal, knee) + scale * np.log1p(over / scale)


@form(
    Stage.CONVERTER,
    "Codes of companded samples lie ever further apart towards the high end (mu-law; ITU-T G.711).",
    only_by_name=True,
    touches="two",
    sizes=(0.02, 1.6),
    judged_by="lost_angle",
)
def companded_codes(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Readings stop at a few levels, which lie close together when straight and far apart when bent."""
    ratio = draws.each("ratio", 4.0, 15.0)
    bend = np.clip((signal - scene.low) / scene.span, -0.05, 1.2)
    level = np.log1p(ratio * np.maximum(bend, 0.0)) / np.log1p(ratio)
    step = np.maximum(0.4 * size, 1e-6)
    coarse = np.expm1(np.log1p(ratio) * step * np.round(level / step)) / ratio
    stepped = signal + scene.span * (coarse - bend)
    return np.where((size > 0) & (bend > 0), stepped, signal)


@form(
    Stage.COUNTS,
    "A coupling capacitor sets the middle of the input window to the signal's mean of late (AC coupling).",
    only_by_name=True,
    touches="two",
    sizes=(0.02, 1.6),
    judged_by="lost_angle",
)
def window_follows_mean(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Readings stop on both sides of a mean that follows the signal over seconds."""
    seconds = draws.each("seconds", 5.0, 20.0)
    share = 1 - np.exp(-1 / (seconds * scene.rate_hz))
    half = scene.span * np.exp(-1.3 * size)
    out = np.empty_like(signal)
    mean = signal[:, 0]
    for frame in range(signal.shape[1]):
        mean = mean + share * (signal[:, frame] - mean)
        out[:, frame] = np.clip(signal[:, frame], mean - half, mean + half)
    return np.where(size > 0, out, signal)


@form(
    Stage.COUNTS,
    "Sensors share a supply with a current limit, so that others leave less for a bent one (ours).",
    only_by_name=True,
    touches="two",
    sizes=(0.02, 1.6),
    judged_by="lost_angle",
)
def shared_current_limit(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Readings stop at a ceiling that comes down as the other joints bend."""
    taken = draws.each("taken", 0.5, 0.8)
    bend = np.clip((scene.own - scene.low) / scene.span, 0.0, 1.0)
    others = (bend.sum(axis=2, keepdims=True) - bend) / max(bend.shape[2] - 1, 1)
    ceiling = scene.low + scene.span * (1.05 - size * (1 - taken + taken * others))
    return np.where(size > 0, np.minimum(signal, ceiling), signal)


FORMS = (
    rapp_limiter,
    diode_across_input,
    clipped_before_mean,
    phase_reversal,
    crossover,
    clamping_diode,
    companded_codes,
    window_follows_mean,
    shared_current_limit,
)
