"""Set-aside forms of temperature."""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Form, Stage, form
from glovecal_models.simulation.scene import Scene


@form(
    Stage.ELECTRICAL,
    "A compensated voltage reference is left with a parabola around its turning point (curvature of "
    "bandgap references, Brokaw 1974).",
    set_aside=True,
)
def bandgap_parabola(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The same on both sides of a turning point near the usual warmth, on zero and span."""
    turning = scene.usual_air[0] + draws.each("turning_c", -1.0, 1.0)
    square = (scene.temperature_c[:, :, None] - turning) ** 2
    return signal + size * draws.signs() * 0.4 * square * (0.5 + (signal - scene.low) / scene.span)


@form(
    Stage.ELECTRICAL,
    "Carbon particles in a polymer part as the binder expands, so that the resistance climbs steeply "
    "above some warmth (positive temperature coefficient of carbon composites, Kohler 1966; Ohe and "
    "Naito 1971).",
    set_aside=True,
)
def binder_expands(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Nothing when cool, ever more when warm."""
    onset = scene.usual_air[0] + draws.each("onset_c", -1.5, 0.3)
    width = draws.each("width_c", 0.2, 0.6)
    above = width * np.logaddexp(0.0, (scene.temperature_c[:, :, None] - onset) / width)
    return signal + size * 2.0 * above


@form(
    Stage.ELECTRICAL,
    "A warm elastomer sleeve is softer and lets the strip bow away from the joint in the middle of "
    "its travel (modulus of rubbers near their transition, Ferry 1980).",
    set_aside=True,
)
def sleeve_softens(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A belly of the curve that comes and goes with the warmth; both ends stay."""
    warmth = scene.temperature_c[:, :, None] - scene.usual_air[0]
    bent = np.clip((signal - scene.low) / scene.span, 0.0, 1.0)
    softer = np.expm1(draws.each("per_c", 0.1, 0.25) * warmth)
    return signal - size * 6.0 * softer * np.sin(np.pi * bent ** draws.each("skew", 0.6, 1.2))


FORMS: tuple[Form, ...] = (bandgap_parabola, binder_expands, sleeve_softens)
