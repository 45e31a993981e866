"""Unknown context: readings follow a recorded quantity that is in no catalogue of causes."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import gaussian_filter1d

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene
from glovecal_models.simulation.signals import lasting_noise


def _wandering(scene: Scene, draws: Draws, name: str, lasts_s: float) -> np.ndarray:
    """A level for each take and slow changes within it, each of standard deviation about 1, shape (T, N)."""
    courses = []
    for start in scene.starts:
        random = draws.stream(name, start.key)
        level = random.standard_normal()
        within = lasting_noise(random, len(scene.time_s), 1, lasts_s, scene.rate_hz)[:, 0]
        smooth = gaussian_filter1d(within, 0.5 * scene.rate_hz)
        courses.append(level + smooth)
    return np.clip(np.array(courses), -3.5, 3.5)


def _strap(scene: Scene, draws: Draws) -> tuple[str, np.ndarray]:
    return "strap_tension_n", 12.0 + 2.5 * _wandering(scene, draws, "strap", 8.0)


def _cabin(scene: Scene, draws: Draws) -> tuple[str, np.ndarray]:
    return "cabin_pressure_hpa", 900.0 + 25.0 * _wandering(scene, draws, "cabin", 30.0)


def _vibration(scene: Scene, draws: Draws) -> tuple[str, np.ndarray]:
    return "tool_vibration_g", np.maximum(2.0 + 0.9 * _wandering(scene, draws, "tool", 4.0), 0.0)


@form(
    Stage.WEARING,
    "A tighter strap pulls the glove back and stretches the sensors, in proportion to tension (ours).",
    only_by_name=True,
    touches="one_or_all",
    column=_strap,
)
def strap_pulls_back(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A shift per newton, in a direction of its own for each sensor."""
    return signal + size * draws.signs() * (_strap(scene, draws)[1][:, :, None] - 12.0) / 2.5


@form(
    Stage.WEARING,
    "Sensors that are sealed air tubes answer less at lower cabin pressure: a change of gain (Boyle; ours).",
    only_by_name=True,
    touches="one_or_all",
    column=_cabin,
)
def air_tubes_in_cabin(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A gain about the lowest angle in proportion to pressure."""
    share = (signal - scene.low) / scene.span
    return signal + size * share * (_cabin(scene, draws)[1][:, :, None] / 900.0 - 1) * 20.0


@form(
    Stage.WEARING,
    "A vibrating tool: the sensor's curve rectifies shaking, a shift with the square of its level (ours).",
    only_by_name=True,
    touches="one_or_all",
    column=_vibration,
)
def rectified_vibration(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Averaged shaking leaves a term of second order."""
    return signal + size * draws.signs() * (_vibration(scene, draws)[1][:, :, None] / 2.0) ** 2


FORMS = (strap_pulls_back, air_tubes_in_cabin, rectified_vibration)
