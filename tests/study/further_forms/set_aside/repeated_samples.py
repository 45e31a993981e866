"""Set-aside forms of repeated samples."""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Form, Stage, form
from glovecal_models.simulation.scene import Scene


def _unrest(scene: Scene, draws: Draws, name: str, lasting_s: float) -> np.ndarray:
    """A process of its own in each take, about uniform over 0..1, lasting ``lasting_s``; (T, N)."""
    times = scene.time_s.size
    kernel = np.exp(-np.arange(round(5 * lasting_s * scene.rate_hz) + 1) / (lasting_s * scene.rate_hz))
    kernel /= np.sqrt(np.sum(kernel**2))
    white = [draws.stream(name, start.key).standard_normal(times + kernel.size - 1) for start in scene.starts]
    normal = np.stack([np.convolve(values, kernel, mode="valid") for values in white])
    return 1.0 / (1.0 + np.exp(-1.702 * normal))


def _held(signal: np.ndarray, lost: np.ndarray) -> np.ndarray:
    """The signal with ``lost`` (T, N) samples filled by the last that came."""
    last = np.maximum.accumulate(np.where(lost, 0, np.arange(lost.shape[1])), axis=1)
    return np.take_along_axis(signal, last[:, :, None], axis=1)


@form(
    Stage.TRANSPORT,
    "A radio link is good or bad for some time, and in bad times nearly all packets are lost (Gilbert"
    " 1960; Elliott 1963).",
    set_aside=True,
    shared=True,
    sizes=(0.005, 0.9),
)
def radio_in_bursts(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The size is the share of time the link is bad; one in ten packets still comes through then."""
    bad = _unrest(scene, draws, "link", draws.one("lasting_s", 0.1, 0.4)) < float(np.max(size))
    through = np.stack([draws.stream("through", start.key).random(bad.shape[1]) for start in scene.starts])
    return _held(signal, bad & (through > 0.1))


@form(
    Stage.TRANSPORT,
    "The logger stops taking packets at regular intervals while it writes a block to its flash card "
    "(busy times in memory card specifications).",
    set_aside=True,
    shared=True,
    sizes=(0.005, 0.9),
)
def flash_writes_stall(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The size is the share of each interval the writing lasts, now shorter and now longer."""
    interval, phase = draws.one("interval_s", 0.5, 1.5), draws.one("phase", 0.0, 1.0)
    beat = scene.session_s / interval + phase
    lasts = float(np.max(size)) * (1.0 + 0.1 * np.sin(2.0 * np.floor(beat)))
    return _held(signal, beat % 1.0 < lasts)


@form(
    Stage.TRANSPORT,
    "The wearer's body shadows the antenna while the arm wanders, so that the chance of losing each "
    "packet rises and falls over seconds (body shadowing at 2.4 GHz, Hall and Hao 2012).",
    set_aside=True,
    shared=True,
    sizes=(0.005, 0.9),
)
def body_shadows_antenna(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Each packet by itself, with a chance that follows a slow fade."""
    shadow = _unrest(scene, draws, "shadow", draws.one("lasting_s", 2.0, 6.0))
    luck = np.stack([draws.stream("luck", start.key).random(shadow.shape[1]) for start in scene.starts])
    strength = float(np.max(size))
    chance = strength * (1.0 - (1.0 - strength) * (1.0 - shadow)) ** 2 / 0.9
    return _held(signal, luck < np.minimum(1.05 * chance, 0.98))


FORMS: tuple[Form, ...] = (radio_in_bursts, flash_writes_stall, body_shadows_antenna)
