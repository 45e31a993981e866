"""Set-aside forms of creep."""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Form, Stage, form
from glovecal_models.simulation.scene import Scene


@form(
    Stage.MECHANICAL,
    "Chains of a polymer backing hop over barriers, so that the flow grows with the hyperbolic sine "
    "of the load (Eyring 1936; Halsey, White and Eyring 1945 for textiles).",
    set_aside=True,
)
def eyring_flow_of_cloth(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Large steps flow fast at first, the last degrees take long."""
    tau, per_deg = draws.each("tau_s", 8.0, 20.0), draws.each("per_deg", 0.05, 0.12)
    flowed = np.empty_like(signal)
    state = signal[:, 0].copy()
    for n in range(signal.shape[1]):
        load = np.clip(per_deg * (signal[:, n] - state), -3.0, 3.0)
        state += np.sinh(load) / (per_deg * tau * scene.rate_hz)
        flowed[:, n] = state
    return signal + size * (flowed - signal) / 8.0


@form(
    Stage.MECHANICAL,
    "Crimped yarns straighten within seconds while the joint stays well bent, and crimp again more "
    "slowly once it opens (elastic recovery of fabrics, Morton and Hearle 2008).",
    set_aside=True,
)
def crimp_straightens(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Only beyond some bend, with different times for both ways."""
    onset = draws.each("onset", 0.05, 0.25)
    straightens, recovers = draws.each("straightens_s", 3.0, 7.0), draws.each("recovers_s", 9.0, 20.0)
    aim = 25.0 * np.maximum((signal - scene.low) / scene.span - onset, 0.0) ** 1.5
    crept = np.empty_like(signal)
    state = 0.5 * aim.mean(axis=1)
    for n in range(signal.shape[1]):
        gap = aim[:, n] - state
        state = state + gap / (np.where(gap > 0, straightens, recovers) * scene.rate_hz)
        crept[:, n] = state
    return signal + size * crept / 2.0


@form(
    Stage.MECHANICAL,
    "Air and moisture are squeezed out of the padding below the strip by diffusion, first with the "
    "root of time (consolidation, Terzaghi 1925; Biot 1941).",
    set_aside=True,
)
def padding_squeezed_out(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Five modes of diffusion; the padding gives way, so the reading drifts back."""
    tau = draws.each("tau_s", 8.0, 22.0)
    odd = 2.0 * np.arange(5) + 1.0
    weight = 1.0 / odd**2
    weight /= weight.sum()
    share = -np.expm1(-(odd**2) / (tau[:, None] * scene.rate_hz))
    drained = np.empty_like(signal)
    state = np.repeat(signal[:, 0, :, None], 5, axis=2)
    for n in range(signal.shape[1]):
        state += share * (signal[:, n, :, None] - state)
        drained[:, n] = state @ weight
    return signal - size * drained / 8.0


FORMS: tuple[Form, ...] = (eyring_flow_of_cloth, crimp_straightens, padding_squeezed_out)
