"""Set-aside forms of a cause outside every catalogue."""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Form, Stage, form
from glovecal_models.simulation.scene import Scene


def _low_pass(values: np.ndarray, tau_s: np.ndarray | float, rate_hz: float) -> np.ndarray:
    """First-order lag along axis 1."""
    share = 1.0 - np.exp(-1.0 / (rate_hz * np.asarray(tau_s)))
    followed = np.empty_like(values)
    state = values[:, 0].copy()
    for n in range(values.shape[1]):
        state += share * (values[:, n] - state)
        followed[:, n] = state
    return followed


def _height(scene: Scene, draws: Draws) -> np.ndarray:
    """How high the hand is above the heart, metres: the arm is moved every few seconds."""
    height = np.empty((len(scene.starts), scene.time_s.size))
    for take, start in enumerate(scene.starts):
        random = draws.stream("arm", start.key)
        moves = scene.time_s[0] + np.cumsum(random.uniform(3.0, 12.0, 40))
        height[take] = random.uniform(-0.45, 0.5, 41)[np.searchsorted(moves, scene.time_s)]
    return _low_pass(_low_pass(height, 0.3, scene.rate_hz), 0.3, scene.rate_hz)


@form(
    Stage.MECHANICAL,
    "Veins of a lowered hand fill within seconds and empty sooner when it is raised, so the fingers "
    "swell and stretch the sleeves (venous occlusion plethysmography, Whitney 1953).",
    set_aside=True,
    column=lambda scene, draws: ("hand_height_m", _height(scene, draws)),
)
def veins_fill_in_lowered_hand(
    signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws
) -> np.ndarray:
    """A slow filling below the heart, a quick emptying above it."""
    fills, empties = draws.each("fills_s", 2.0, 6.0), draws.each("empties_s", 0.8, 2.0)
    aim = 1.0 / (1.0 + np.exp(8.0 * _height(scene, draws)))
    swollen = np.empty_like(signal)
    state = np.repeat(aim[:, :1], signal.shape[2], axis=1)
    for n in range(signal.shape[1]):
        gap = aim[:, n, None] - state
        state = state + gap / (np.where(gap > 0, fills, empties) * scene.rate_hz)
        swollen[:, n] = state
    return signal + size * draws.signs() * 3.0 * swollen


def _shaking(scene: Scene, draws: Draws) -> np.ndarray:
    """Vibration of a hand-held tool, RMS in g: on for some seconds, pressed more or less."""
    shaking = np.empty((len(scene.starts), scene.time_s.size))
    for take, start in enumerate(scene.starts):
        random = draws.stream("tool", start.key)
        switches = scene.time_s[0] + np.cumsum(random.uniform(1.5, 7.0, 80))
        level = np.where(np.arange(81) % 2 == 0, 0.03, random.uniform(0.8, 4.0, 81))
        shaking[take] = level[np.searchsorted(switches, scene.time_s)]
    return _low_pass(shaking, 0.25, scene.rate_hz)


@form(
    Stage.ELECTRICAL,
    "Vibration of a power tool is rectified by the sensor's curved response and its amplifier, which "
    "leaves a constant bias with the square of the acceleration (vibration rectification in "
    "accelerometer and amplifier data sheets).",
    set_aside=True,
    column=lambda scene, draws: ("tool_vibration_g", _shaking(scene, draws)),
)
def vibration_rectified(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A bias with the square at first, then with the vibration itself."""
    knee = draws.each("knee_g", 0.7, 2.5)
    shaking = _shaking(scene, draws)[:, :, None]
    return signal + size * draws.signs() * 2.5 * (np.sqrt(1.0 + (shaking / knee) ** 2) - 1.0)


def _charge(scene: Scene, draws: Draws) -> np.ndarray:
    """Charge of the cloth, kilovolts: rubbing builds it up, it leaks, touching metal takes it away."""
    leaks = np.exp(-1.0 / (scene.rate_hz * draws.one("leaks_s", 8.0, 25.0)))
    rubbing = np.empty((len(scene.starts), scene.time_s.size))
    touched = np.empty(rubbing.shape, dtype=bool)
    for take, start in enumerate(scene.starts):
        random = draws.stream("sleeve", start.key)
        turns = scene.time_s[0] + np.cumsum(random.exponential(4.0, 120))
        rubbing[take] = random.gamma(0.8, 1.0, 121)[np.searchsorted(turns, scene.time_s)]
        touched[take] = random.random(scene.time_s.size) < 1.0 / (7.0 * scene.rate_hz)
    charge = np.zeros_like(rubbing)
    state = np.zeros(rubbing.shape[0])
    for n in range(rubbing.shape[1]):
        state = np.where(touched[:, n], 0.0, state * leaks + 0.3 * rubbing[:, n] / scene.rate_hz)
        charge[:, n] = state
    return charge


@form(
    Stage.ELECTRICAL,
    "A synthetic sleeve charges by rubbing and its field pulls at the electrodes of stretch "
    "capacitors until a spark or touch takes the charge away (triboelectric charging, Henniker 1962).",
    set_aside=True,
    column=lambda scene, draws: ("cloth_charge_kv", _charge(scene, draws)),
)
def cloth_charges(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A bias with the charge, less for a bent sensor, whose plates are further apart."""
    bent = np.clip((signal - scene.low) / scene.span, 0.0, 1.0)
    charge = _charge(scene, draws)[:, :, None]
    return signal + size * draws.signs() * 2.5 * charge * (1.0 - draws.each("bent_less", 0.2, 0.6) * bent)


FORMS: tuple[Form, ...] = (veins_fill_in_lowered_hand, vibration_rectified, cloth_charges)
