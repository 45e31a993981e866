"""Nonlinearity: a sensor's answer to its own joint is no straight line.

Light through two polarisers, a converter whose heavy bits are off, and a strip that arches up. Every form
keeps the range's ends in place.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene


@form(
    Stage.ELECTRICAL,
    "Light through two polarisers that the joint turns: the squared cosine of their angle (Malus 1809).",
    set_aside=True,
    judged_by="straight_line",
)
def two_polarisers(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Each sensor sees the squared cosine of an angle that starts anywhere and turns with the bend."""
    start, turn = draws.each("start", -0.3, 0.9), draws.each("turn", 1.3, 2.1)

    def light(bend: np.ndarray | float) -> np.ndarray:
        return np.cos(start + turn * bend) ** 2

    return signal + size * 4 * _between_ends(light, _bend(signal, scene))


@form(
    Stage.ELECTRICAL,
    "Capacitors for the three heaviest bits of a converter are off, which makes steps (SAR data sheets).",
    set_aside=True,
    judged_by="straight_line",
)
def heavy_bits_off(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Each sensor jumps wherever one of the three heaviest bits of its converter changes."""
    errors = [draws.each(f"bit_{bit}", 0.6, 1.2) * draws.signs(f"sign_{bit}") / bit for bit in (1, 2, 3)]
    start, share = draws.each("first_code", 0.05, 0.25), draws.each("used_share", 0.6, 0.75)

    def off(bend: np.ndarray | float) -> np.ndarray:
        code = np.clip(start + share * bend, 0.0, 0.999)
        return np.sum([error * (np.floor(code * 2**bit) % 2) for bit, error in enumerate(errors, 1)], axis=0)

    return signal + size * 2 * _between_ends(off, _bend(signal, scene))


@form(
    Stage.ELECTRICAL,
    "A strip held at both ends arches up by the root of its shortening (height of a shallow buckled beam).",
    set_aside=True,
    judged_by="straight_line",
)
def arch_of_held_strip(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Each sensor reads the height of an arch, which rises with the root of how far its ends approach."""
    at_start = draws.each("arched_before", 0.001, 0.03)
    from_high = draws.signs("starts_at") < 0

    def height(bend: np.ndarray | float) -> np.ndarray:
        pushed = np.where(from_high, 1 - bend, bend)
        return np.where(from_high, -1.0, 1.0) * np.sqrt(np.maximum(pushed, 0.0) + at_start)

    return signal + size * 5 * _between_ends(height, _bend(signal, scene))


def _bend(signal: np.ndarray, scene: Scene) -> np.ndarray:
    return np.clip((signal - scene.low) / scene.span, -0.2, 1.2)


def _between_ends(curve: Callable[..., np.ndarray], bend: np.ndarray) -> np.ndarray:
    """What a curve differs from the straight line through its two ends."""
    return np.asarray(curve(bend) - (1 - bend) * curve(0.0) - bend * curve(1.0))


FORMS = (two_polarisers, heavy_bits_off, arch_of_held_strip)
