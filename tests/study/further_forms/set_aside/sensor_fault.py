"""Set-aside forms of sensor fault."""

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


@form(
    Stage.COUNTS,
    "A cracked ink trace opens for moments, more when bent, and its resistance shows as spikes to one"
    " side (fatigue of printed silver conductors, Sim and others 2013).",
    set_aside=True,
    touches="one",
    sizes=(0.001, 1.0),
)
def cracked_trace_spikes(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The size is the share of time in which the crack of a bent strip may open."""
    unrest = _unrest(scene, draws, "crack", draws.one("lasting_s", 0.03, 0.1))[:, :, None]
    bent = np.clip((scene.own - scene.low) / scene.span, 0.0, 1.0)
    open_share = np.maximum(unrest - 1.0 + size * (0.3 + 0.7 * np.sqrt(bent)), 0.0)
    return signal + draws.sign() * draws.one("jump_deg", 60.0, 120.0) * open_share


@form(
    Stage.CONVERTER,
    "A plug whose screen has come loose picks up the mains, folded down by the sampling, whenever its"
    " shell loses touch (interference coupling, Ott 2009).",
    set_aside=True,
    touches="one",
    sizes=(0.001, 1.0),
)
def loose_screen_hums(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Mains with its third harmonic, on and off over seconds."""
    mains, third = draws.one("mains_hz", 49.95, 50.05), draws.one("third", 0.1, 0.4)
    loose = _unrest(scene, draws, "shell", draws.one("lasting_s", 1.0, 4.0))[:, :, None] ** 3
    turn = 2 * np.pi * mains * scene.session_s[:, :, None]
    return signal + size * 40.0 * loose * (np.sin(turn + 0.7) + third * np.sin(3 * turn))


@form(
    Stage.CONVERTER,
    "A cold solder joint leaves the input of the sample-and-hold open for moments, and the converter "
    "repeats the charge it holds, which leaks away slowly (Horowitz and Hill 2015).",
    set_aside=True,
    touches="one",
    sizes=(0.001, 1.0),
)
def floating_input_leaks(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The size is the share of time the input floats; the held value sinks, then jumps back."""
    unrest = _unrest(scene, draws, "joint", draws.one("lasting_s", 0.3, 1.0))[:, :, None]
    floats = unrest < size
    grid = np.arange(signal.shape[1])[:, None]
    last = np.maximum.accumulate(np.where(floats, 0, grid), axis=1)
    held = np.take_along_axis(signal, last, axis=1)
    keeps = np.exp(-(grid - last) / (scene.rate_hz * draws.one("leaks_s", 1.0, 5.0)))
    level = scene.low + draws.each("level", 0.0, 0.3) * scene.span
    return np.where(floats, level + (held - level) * keeps, signal)


FORMS: tuple[Form, ...] = (cracked_trace_spikes, loose_screen_hums, floating_input_leaks)
