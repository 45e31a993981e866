"""Contact pressure: what the hand grips presses on the sensors; here it is recorded as ``contact_n``.

Thin films answer to normal force as well as to bending (thin-film force sensors: Tang 2020, Sensors 20(23)
6863). Sizes and laws are ours. Grips come and go with forces up to some 20
newtons, mostly while the hand is closed.
"""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene

RISE_S = 0.12


def contact_column(scene: Scene, draws: Draws) -> tuple[str, np.ndarray]:
    """The measured pressure, newtons, shape (T, N)."""
    pressure = _pressure(scene, draws)[:, :, 0]
    noise = 0.08 * draws.stream("column noise", scene.starts[0].key).standard_normal(pressure.shape)
    return "contact_n", np.round(np.maximum(pressure + noise, 0.0), 3)


def _pressure(scene: Scene, draws: Draws) -> np.ndarray:
    """Newtons, shape (T, N, 1): grips that begin when the hand is rather closed."""
    rows = []
    for row, start in enumerate(scene.starts):
        random = draws.stream("grips", start.key)
        force = np.zeros(len(scene.time_s))
        now = 0
        while now < len(force):
            now += int(random.uniform(0.5, 3.0) * scene.rate_hz)
            length = int(random.uniform(0.6, 4.0) * scene.rate_hz)
            newtons = random.gamma(2.5, 3.0)
            if now < len(force) and scene.closing[row, now] + random.uniform(-0.25, 0.25) > 0.35:
                force[now : now + length] = min(newtons, 25.0)
                now += length
        width = max(int(RISE_S * 2 * scene.rate_hz), 1)
        window = np.hanning(width + 2)[1:-1]
        rows.append(np.convolve(force, window / window.sum(), mode="same"))
    return np.stack(rows)[:, :, None]


@form(
    Stage.MECHANICAL, "Degrees per newton, whatever the bend (normal force on a film).", column=contact_column
)
def additive(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """So many degrees per newton."""
    return signal + size * draws.sign() * draws.each("per_n", 0.5, 1.5) * _pressure(scene, draws)


@form(
    Stage.MECHANICAL,
    "Degrees per newton that grow with the bend (tight cloth presses harder).",
    column=contact_column,
)
def times_bend(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """More, the more the joint is bent: the cloth is tight there."""
    bent = draws.each("unbent_share", 0.1, 0.4) + (signal - scene.low) / scene.span
    return signal + size * draws.sign() * bent * _pressure(scene, draws)


@form(
    Stage.MECHANICAL,
    "The first newtons count most, then it levels off (padding pressed flat).",
    column=contact_column,
)
def levels_off(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The first newtons count most: the padding is soon pressed flat."""
    flat_n = draws.each("flat_n", 2.0, 5.0)
    return signal - size * draws.signs() * np.expm1(-_pressure(scene, draws) / flat_n)


@form(
    Stage.MECHANICAL,
    "Padding gives way with the two-thirds power of the force (Hertz 1882).",
    column=contact_column,
    only_by_name=True,
)
def hertz(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Degrees in proportion to the depth of a round fingertip in its padding."""
    _, newtons = contact_column(scene, draws)
    weight = draws.each("hertz_weight", 0.6, 1.4) * draws.signs("hertz_signs")
    return signal + size * weight * np.maximum(newtons, 0.0)[..., None] ** (2 / 3)


@form(
    Stage.MECHANICAL,
    "Little at a light touch, then a steep rise and a limit (curve of Hill 1910, as of foam that closes).",
    column=contact_column,
    only_by_name=True,
)
def foam_closes(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A power of the force over one plus that power."""
    _, newtons = contact_column(scene, draws)
    half_n = draws.each("foam_half_n", 1.5, 4.0)
    steep = draws.each("foam_steep", 2.0, 4.0)
    power = (np.maximum(newtons, 0.0)[..., None] / half_n) ** steep
    return signal + size * 3 * draws.signs("foam_signs") * power / (1 + power)


@form(
    Stage.MECHANICAL,
    "Pressure flattens the sensor of a straight finger and folds that of a bent one (buckling; ours).",
    column=contact_column,
    only_by_name=True,
)
def flattens_or_folds(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The force times a half wave over the bend, which changes its sign in mid-range."""
    _, newtons = contact_column(scene, draws)
    turns = draws.each("fold_turns", 0.35, 0.6)
    bend = np.clip((signal - scene.low) / scene.span, 0.0, 1.0)
    return signal + size * np.sin(np.pi * (bend - turns)) * newtons[..., None]


FORMS = (
    additive,
    times_bend,
    levels_off,
    hertz,
    foam_closes,
    flattens_or_folds,
)
