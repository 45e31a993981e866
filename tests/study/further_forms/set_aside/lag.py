"""Set-aside forms of lag."""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Form, Stage, form
from glovecal_models.simulation.scene import Scene


def _running_mean(values: np.ndarray, width: float) -> np.ndarray:
    """Mean over the last ``width`` samples (any positive number) of straight lines between values (T, N)."""
    padded = np.pad(values, ((0, 0), (int(width) + 2, 0)), mode="edge")
    area = np.pad(np.cumsum(0.5 * (padded[:, 1:] + padded[:, :-1]), axis=1), ((0, 0), (1, 0)))
    now = np.arange(padded.shape[1] - values.shape[1], padded.shape[1])
    cell = np.floor(now - width).astype(int)
    part = (now - width) - cell
    first, second = padded[:, cell], padded[:, cell + 1]
    before = area[:, cell] + part * first + 0.5 * part**2 * (second - first)
    return (area[:, now] - before) / width


@form(
    Stage.MECHANICAL,
    "Muscles bend the strip at once but only its own spring straightens it, slowly in a tight sleeve "
    "(recovery time in bend sensor data sheets).",
    set_aside=True,
    sizes=(0.001, 0.6),
)
def slow_recoil(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A short time constant while bending, a long one while opening; size in seconds."""
    quick = draws.each("quick_share", 0.05, 0.2)
    opening = np.maximum(size, 1e-6)
    closing = opening * quick
    share_open, share_close = (
        -np.expm1(-1.0 / (scene.rate_hz * opening)),
        -np.expm1(-1.0 / (scene.rate_hz * closing)),
    )
    followed = np.empty_like(signal)
    state = signal[:, 0].copy()
    for n in range(signal.shape[1]):
        gap = signal[:, n] - state
        state += np.where(gap > 0, share_close, share_open) * gap
        followed[:, n] = state
    return followed


@form(
    Stage.ELECTRICAL,
    "A piezoresistive strip of megohms charges its cable and input filter, with a time that grows as "
    "its resistance does with the bend (RC input, Horowitz and Hill 2015).",
    set_aside=True,
    sizes=(0.001, 0.4),
)
def charging_grows_with_bend(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """First order; the time constant is much longer for a bent strip; size in seconds."""
    grows = draws.each("grows", 1.0, 4.0)
    bent = np.clip((signal - scene.low) / scene.span, 0.0, 1.2)
    share = -np.expm1(-1.0 / (scene.rate_hz * np.maximum(size, 1e-6) * (0.4 + grows * bent)))
    followed = np.empty_like(signal)
    state = signal[:, 0].copy()
    for n in range(signal.shape[1]):
        state += share[:, n] * (signal[:, n] - state)
        followed[:, n] = state
    return followed


@form(
    Stage.ELECTRICAL,
    "A sigma-delta converter for each sensor averages three times over its conversion time (sinc "
    "filter, Hogenauer 1981; capacitance converter data sheets).",
    set_aside=True,
    sizes=(0.001, 0.4),
)
def sinc_converter(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Three running means in a row over the size in seconds; the chips' times differ a little."""
    window = size * draws.each("window", 0.7, 1.3)
    smooth = signal.copy()
    for column in np.flatnonzero(window > 1e-5):
        for _ in range(3):
            smooth[:, :, column] = _running_mean(smooth[:, :, column], window[column] * scene.rate_hz)
    return smooth


FORMS: tuple[Form, ...] = (slow_recoil, charging_grows_with_bend, sinc_converter)
