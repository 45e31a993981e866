"""Palm arch: a soft pad that follows late, loose cloth that sags, and a stiff patch that pops."""

from __future__ import annotations

import numpy as np
from scipy.signal import lfilter

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene


@form(
    Stage.MECHANICAL,
    "The palm's soft pad follows the arch within a second or two and takes the cloth along (Kelvin-Voigt).",
    only_by_name=True,
    touches="palm",
)
def soft_pad_follows_late(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The arch behind one relaxation time, in proportion."""
    keep = np.exp(-1 / (draws.one("lasts_s", 0.5, 2.0) * scene.rate_hz))
    arch = scene.rotation("PALM_ARCH")
    late = lfilter([1 - keep], [1.0, -keep], arch - arch[:, :1], axis=1) + arch[:, :1]
    return signal + size * draws.signs() * 0.5 * late[:, :, None]


@form(
    Stage.MECHANICAL,
    "Cloth across the hollow goes loose by the arch and sags by the root of the excess (shallow catenary).",
    only_by_name=True,
    touches="palm",
)
def loose_cloth_sags(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The sag draws the fingers' cloth aside."""
    sag = np.sqrt(np.maximum(scene.rotation("PALM_ARCH"), 0.0))
    return signal + size * draws.signs() * 2 * sag[:, :, None]


@form(
    Stage.MECHANICAL,
    "A stiff patch on the glove's back pops over at one arch and back at a lower one (bistable; ours).",
    only_by_name=True,
    touches="palm",
)
def stiff_patch_pops(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Two states of the patch; popping takes some hundredths of a second."""
    over, back = draws.one("over_deg", 13.0, 16.5), draws.one("back_deg", 8.0, 11.0)
    arch = scene.rotation("PALM_ARCH")
    decided = np.where((arch > over) | (arch < back), np.arange(arch.shape[1]), 0)
    last = np.maximum.accumulate(decided, axis=1)
    popped = np.take_along_axis(arch, last, axis=1) > (over + back) / 2
    keep = np.exp(-1 / (0.03 * scene.rate_hz))
    moved = lfilter([1 - keep], [1.0, -keep], popped.astype(float), axis=1)
    return signal + size * draws.signs() * 5 * moved[:, :, None]


FORMS = (soft_pad_follows_late, loose_cloth_sags, stiff_patch_pops)
