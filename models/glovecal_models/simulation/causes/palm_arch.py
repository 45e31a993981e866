"""Palm arch: cupping the palm turns the outer metacarpal bones, and the sensors over them answer.

Krnoul et al. 2016 had to add the palm sensor to the rotations of the little finger's and the thumb's
metacarpal: R_ppx = a TRC_px + b (2), R_pmx = a TRC_pmx + b + 0.75 R_ppx (3), R_tma = a TRC_tma + b +
a_tpx TRC_px + b_tpx (5). Here the arch's angle acts on the sensors over those bones.
A person also cups the palm independently of the fingers, so that only a palm sensor tells all of it.
"""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene

LITTLE_SHARE = 0.75
"""Krnoul 2016, equation (3)."""
_SIDE = {"P_MCP": LITTLE_SHARE, "RP_ABD": -0.3, "R_MCP": 0.4, "T_TMC": -0.5, "TI_ABD": -0.6}


@form(
    Stage.MECHANICAL,
    "In proportion to the arch: little finger 0.75, thumb the other way (Krnoul 2016, (2), (3), (5)).",
    touches="palm",
)
def linear(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The arch's angle, weighed by how far each bone turns with it."""
    return signal + size * _weights(scene, draws) * _arch(scene)


@form(
    Stage.MECHANICAL,
    "One minus the cosine of the arch: bones on a cylinder, little effect while the palm is flat.",
    touches="palm",
)
def cylinder(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Bones on a bent cylinder: cloth shortens with one minus the cosine of the arch, little at first."""
    turned = np.deg2rad(_arch(scene) * draws.one("turn_per_arch", 1.5, 3.0))
    return signal + size * _weights(scene, draws) * (1 - np.cos(turned))


@form(
    Stage.MECHANICAL,
    "The product of arch and thumb opposition (Krnoul 2016: for thumb and little finger to touch).",
    touches="palm",
)
def with_opposition(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The arch pulls only as far as the thumb stands across the palm: a product of the two."""
    opposed = draws.one("unopposed_share", 0.05, 0.2) + scene.bent("T_TMC")[:, :, None]
    return signal + size * _weights(scene, draws) * _arch(scene) * opposed


def _arch(scene: Scene) -> np.ndarray:
    """Shape (T, N, 1), degrees."""
    return scene.rotation("PALM_ARCH")[:, :, None]


def _weights(scene: Scene, draws: Draws) -> np.ndarray:
    own = np.array([_SIDE.get(name, LITTLE_SHARE) for name in scene.sensors])
    return own * draws.each("weight", 0.7, 1.3)


@form(
    Stage.MECHANICAL,
    "The first degrees of arch count most, then the cloth across the palm is slack (exponential; ours).",
    touches="palm",
    only_by_name=True,
)
def levels_off(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The pull approaches a limit exponentially as the palm is cupped."""
    soon = draws.each("soon", 0.1, 0.35)
    arch = scene.bent("PALM_ARCH")[..., None]
    return signal + size * 3 * draws.signs() * (0.4 + np.expm1(-arch / soon))


@form(
    Stage.MECHANICAL,
    "Cupping tilts the joint's axis, so that the sensor sees its bend in projection (tilted hinge; ours).",
    touches="palm",
    only_by_name=True,
)
def tilted_axis(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The square of the arch times the sine of twice the bend: a tilted hinge's first term."""
    start = draws.each("untilted_deg", -10.0, 25.0)
    arch = scene.bent("PALM_ARCH")[..., None]
    return signal - size * 4 * arch**2 * np.sin(2 * np.radians(signal + start))


@form(
    Stage.MECHANICAL,
    "A fold across the palm forms at a certain arch and takes up cloth while it forms (sigmoid; ours).",
    touches="palm",
    only_by_name=True,
)
def palm_fold(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The pull goes from one level to another around one arch, differently placed for each sensor."""
    place = draws.each("place", 0.25, 0.55)
    width = draws.each("width", 0.06, 0.15)
    arch = scene.bent("PALM_ARCH")[..., None]
    return signal + size * 1.5 * draws.signs() * np.tanh((arch - place) / width)


FORMS = (
    linear,
    cylinder,
    with_opposition,
    levels_off,
    tilted_axis,
    palm_fold,
)
