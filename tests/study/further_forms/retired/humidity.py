"""Humidity: readings move with the humidity that the hygrometer shows.

Cloth wets faster than it dries, dry air lets charge stay on the cloth, and two layers that swell unequally
balance at one humidity only.

Cloth wets faster than it dries, water changes what a capacitor holds, and hygroscopic layers curl.

Salt on the contacts may turn into brine, damp cloth may drag, or water may detune a coil.
"""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene


@form(
    Stage.ELECTRICAL,
    "Fibres take up water quicker than they give it off, and zero points follow the water (sorption"
    " kinetics).",
    only_by_name=True,
)
def wets_quicker_than_dries(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The water runs after the humidity within seconds upwards and within a minute or two downwards."""
    wets = -np.expm1(-1 / (draws.one("wets_s", 4.0, 12.0) * scene.rate_hz))
    dries = -np.expm1(-1 / (draws.one("dries_s", 60.0, 150.0) * scene.rate_hz))
    air = scene.humidity_pct - scene.usual_air[1]
    water = np.empty_like(air)
    state = air[:, 0]
    for frame in range(air.shape[1]):
        missing = air[:, frame] - state
        state = state + np.where(missing > 0, wets, dries) * missing
        water[:, frame] = state
    return signal + size * draws.signs() * draws.each("share", 0.6, 1.4) * water[:, :, None]


@form(
    Stage.ELECTRICAL,
    "Dry air lets charge stay on the cloth, damp air leads it away: exponential in dryness"
    " (triboelectricity).",
    only_by_name=True,
)
def dry_cloth_charges(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Zero points move the more steeply the drier the air, and near the bent end half as far again."""
    e_fold = draws.one("e_fold_pct", 2.5, 6.0)
    charge = np.exp(np.clip((scene.usual_air[1] - scene.humidity_pct) / e_fold, -8.0, 4.0))[:, :, None]
    nearer = 1 + 0.5 * np.clip((signal - scene.low) / scene.span, 0.0, 1.0)
    return signal + size * draws.signs() * 3.0 * (charge - 1.0) * nearer


@form(
    Stage.ELECTRICAL,
    "Two layers that swell unequally balance at one humidity and curl the strip on both sides of it (ours).",
    only_by_name=True,
)
def layers_balance_once(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Nothing at one humidity, and with the square of the difference above and below."""
    balance = scene.usual_air[1] + draws.one("balance_pct", -1.5, 1.5)
    off = np.square((scene.humidity_pct - balance) / 4.0)[:, :, None]
    return signal + size * draws.signs() * draws.each("share", 0.6, 1.4) * 3.0 * (off - 0.7)


@form(
    Stage.ELECTRICAL,
    "Zero points follow the humidity: soon while it rises, late while it falls (drying is the slower way).",
    only_by_name=True,
)
def dries_slowly(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Water taken up within seconds and given off within minutes."""
    wets_s, dries_s = draws.one("wets_s", 4.0, 15.0), draws.one("dries_s", 60.0, 180.0)
    water = np.empty_like(scene.humidity_pct)
    state = scene.humidity_pct[:, 0]
    for frame in range(water.shape[1]):
        away = scene.humidity_pct[:, frame] - state
        state = state + away * np.where(away > 0, 1 / wets_s, 1 / dries_s) / scene.rate_hz
        water[:, frame] = state
    return signal + size * draws.signs() * 0.5 * (water - scene.usual_air[1])[:, :, None]


@form(
    Stage.ELECTRICAL,
    "A capacitor's filling of fibre, air and water: gains by the cube of mixed cube roots (Looyenga 1965).",
    only_by_name=True,
)
def wet_dielectric(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The permittivity of damp cloth sets how much a degree counts."""
    holds = draws.each("holds", 0.1, 0.3)
    damp, usual = scene.humidity_pct[:, :, None] / 100, scene.usual_air[1] / 100
    mixed = (1 + holds * (80 ** (1 / 3) - 1) * damp**2) ** 3
    rest = (1 + holds * (80 ** (1 / 3) - 1) * usual**2) ** 3
    bend = (signal - scene.low) / scene.span
    return signal + size * draws.sign() * 10 * bend * (mixed / rest - 1)


@form(
    Stage.ELECTRICAL,
    "A layer that swells curls the straight strip; a bent strip is held flat against the finger (ours).",
    only_by_name=True,
)
def curling_strip(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """In proportion to the humidity times the square of what is left to bend."""
    left = np.clip((scene.high - signal) / scene.span, 0, 1) ** draws.each("power", 1.5, 3.0)
    damp = (scene.humidity_pct - scene.usual_air[1])[:, :, None]
    return signal + size * draws.signs() * damp * left


@form(
    Stage.ELECTRICAL,
    "Salt of sweat turns to brine at one humidity and dries again at a lower one (deliquescence).",
    only_by_name=True,
)
def salt_turns_to_brine(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Brine leaks beside the sensor from one humidity on until another one, more so when it is bent."""
    middle = scene.usual_air[1] + draws.one("from_usual", -0.5, 0.5)
    half, gain = draws.one("half_gap", 0.2, 0.7), draws.each("gain", 0.2, 0.8)
    air = scene.humidity_pct
    state = np.where(air[:, 0] > middle, 1.0, 0.0)
    brine = np.empty_like(air)
    for frame in range(air.shape[1]):
        now = air[:, frame]
        state = np.where(now > middle + half, 1.0, np.where(now < middle - half, 0.0, state))
        brine[:, frame] = state
    bend = (signal - scene.low) / scene.span
    return signal - size * 2 * brine[:, :, None] * (1 - gain + gain * bend)


@form(
    Stage.ELECTRICAL,
    "Damp cloth clings to the skin, and the strip lags behind both ways"
    " (skin friction; Derler & Gerhardt 2012).",
    only_by_name=True,
)
def damp_cloth_clings(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A slack that has to be taken up counts in damp air and not in dry air."""
    slack, width = draws.each("slack_deg", 4.0, 9.0), draws.one("width", 0.8, 2.0)
    damp = (1 + np.tanh((scene.humidity_pct - scene.usual_air[1]) / width))[:, :, None] / 2
    out = np.empty_like(signal)
    place = signal[:, 0]
    for frame in range(signal.shape[1]):
        place = np.clip(place, signal[:, frame] - slack, signal[:, frame] + slack)
        out[:, frame] = place
    return signal + size * 0.5 * damp * (out - signal)


@form(
    Stage.ELECTRICAL,
    "Water in the cloth detunes a coil and its capacitor past the frequency they are read at"
    " (resonance curve).",
    only_by_name=True,
)
def detuned_coil(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Zero points rise to a peak at one humidity and fall off on both sides of it."""
    at = scene.usual_air[1] + draws.each("from_usual", -1.5, 1.5)
    width = draws.each("width", 0.6, 1.8)
    away = (scene.humidity_pct[:, :, None] - at) / width
    return signal + size * 3 * draws.signs() / (1 + away**2)


FORMS = (
    wets_quicker_than_dries,
    dry_cloth_charges,
    layers_balance_once,
    dries_slowly,
    wet_dielectric,
    curling_strip,
    salt_turns_to_brine,
    damp_cloth_clings,
    detuned_coil,
)
