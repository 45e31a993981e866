"""Unknown context: the earth's field as the hand turns, stray light, and blood that leaves a raised hand."""

from __future__ import annotations

import numpy as np
from scipy.signal import lfilter

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene
from glovecal_models.simulation.signals import lasting_noise


def _wander(scene: Scene, draws: Draws, name: str, lasts_s: float) -> np.ndarray:
    """About standard deviation 1, another level in each take and slow changes within it, shape (T, N)."""
    course = []
    for start in scene.starts:
        random = draws.stream(name, start.key)
        level = random.standard_normal()
        noise = lasting_noise(random, len(scene.time_s) + 120, 1, lasts_s, scene.rate_hz)[:, 0]
        course.append(0.7 * level + 0.7 * np.convolve(noise, np.full(121, 1 / 121), mode="valid"))
    return np.stack(course)


def _heading(scene: Scene, draws: Draws) -> tuple[str, np.ndarray]:
    return "heading_deg", 180 + 60 * _wander(scene, draws, "heading", 5.0)


def _light(scene: Scene, draws: Draws) -> tuple[str, np.ndarray]:
    return "light_lux", 300 * np.exp(1.1 * _wander(scene, draws, "light", 8.0))


def _elevation(scene: Scene, draws: Draws) -> tuple[str, np.ndarray]:
    return "arm_elevation_deg", 75 * np.tanh(0.8 * _wander(scene, draws, "elevation", 12.0))


@form(
    Stage.WEARING,
    "A Hall sensor sees the earth's field too, by the cosine of heading and own bend together (ours).",
    only_by_name=True,
    touches="one_or_all",
    column=_heading,
)
def earth_field_as_hand_turns(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The field's direction on the phalanx is heading plus bend plus how the sensor is mounted."""
    turned = np.radians(_heading(scene, draws)[1][:, :, None] + signal)
    return signal + size * 3 * np.cos(turned + draws.each("mounted", 0.0, 2 * np.pi))


@form(
    Stage.WEARING,
    "Stray light adds to a fibre's own light before a logarithmic amplifier: the logarithm of a sum (ours).",
    only_by_name=True,
    touches="one_or_all",
    column=_light,
)
def stray_light_before_logarithm(
    signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws
) -> np.ndarray:
    """The fibre's own light falls exponentially with the bend, so that bent joints suffer most."""
    loss, equal_lux = draws.each("loss", 1.0, 2.5), draws.one("equal_lux", 500.0, 3000.0)
    bend = np.clip((signal - scene.low) / scene.span, -0.2, 1.2)
    stray = _light(scene, draws)[1][:, :, None] / equal_lux
    return signal - size * 5 * np.log1p(stray * np.exp(loss * bend))


@form(
    Stage.WEARING,
    "Blood leaves a raised hand within half a minute: delayed sine of the arm's elevation (ours).",
    only_by_name=True,
    touches="one_or_all",
    column=_elevation,
)
def blood_leaves_raised_hand(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The fingers' girth follows the height of the blood column with one time constant."""
    keep = np.exp(-1 / (draws.one("lasts_s", 10.0, 30.0) * scene.rate_hz))
    height = np.sin(np.radians(_elevation(scene, draws)[1]))
    girth = lfilter([1 - keep], [1.0, -keep], height - height[:, :1], axis=1) + height[:, :1]
    return signal - size * 3 * girth[:, :, None]


FORMS = (earth_field_as_hand_turns, stray_light_before_logarithm, blood_leaves_raised_hand)
