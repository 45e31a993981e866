"""Nonlinearity: a curve over the own bend that is the same at every moment, and not straight.

Beyond one bow or one corner, real sensors show the steep law of a magnet that moves away, the waves of an
angle computed from two unequal channels, and the scallops of a strip made of several printed sections.

Potentiometers, optical gratings and strips with two patches each leave a curve of their own.

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
    "A magnet leaves its Hall sensor as the finger bends: inverse cube of the distance (dipole field).",
    only_by_name=True,
    judged_by="straight_line",
)
def magnet_leaves(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The field of a dipole over the bend, scaled to be right at both ends of the range."""
    travel = draws.each("travel_per_gap", 0.5, 1.3)
    share = np.clip(_share(signal, scene), -0.2, 1.2)
    field = (1 + travel * share) ** -3.0
    far = (1 + travel) ** -3.0
    answer = (1 - field) / (1 - far)
    return signal + size * draws.signs() * 10.0 * (answer - share)


@form(
    Stage.ELECTRICAL,
    "Sine and cosine channels of a magnetic encoder of unequal offset and height (first and second"
    " harmonic).",
    only_by_name=True,
    judged_by="straight_line",
)
def encoder_harmonics(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A wave over the electrical angle and one of half its length, as of an encoder with several poles."""
    turns = np.deg2rad(draws.each("pole_pairs", 4.0, 7.0) * signal)
    first = draws.each("first_phase", 0.0, 2 * np.pi)
    second = draws.each("second_phase", 0.0, 2 * np.pi)
    share = draws.each("second_share", 0.2, 0.5)
    return signal + size * (np.sin(turns + first) + share * np.sin(2 * turns + second))


@form(
    Stage.ELECTRICAL,
    "A strip of three or four printed sections, each of which bows on its own (segmented flex sensor; ours).",
    only_by_name=True,
    judged_by="straight_line",
)
def printed_sections(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Scallops over the bend: one arch for every section, with corners between them."""
    sections = draws.each("sections", 2.6, 4.2)
    place = draws.each("first_corner", 0.0, 1.0)
    within = np.mod(_share(signal, scene) * sections + place, 1.0)
    # A section is stiffest at its ends, where the conducting pads sit.
    return signal + size * draws.signs() * 5.0 * (4 * within * (1 - within) - 2 / 3)


def _share(signal: np.ndarray, scene: Scene) -> np.ndarray:
    """The signal as a share of the sensor's range, a little below 0 and above 1 at the ends."""
    return (signal - scene.low) / scene.span


@form(
    Stage.ELECTRICAL,
    "A potentiometer whose wiper is loaded: low by the turn squared times what is left (circuit theory).",
    only_by_name=True,
    judged_by="straight_line",
)
def loaded_potentiometer(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The wiper of a potentiometer feeds too small a resistance, worst at two thirds of the turn."""
    load = draws.each("load", 0.6, 2.5)
    turn = np.clip(_share_again(signal, scene), 0, 1)
    loss = turn**2 * (1 - turn) * (1 + load) / (1 + load * turn * (1 - turn))
    return signal - size * draws.sign() * 6.75 * loss


@form(
    Stage.ELECTRICAL,
    "A ripple of a few periods over the range (interpolation error of gratings; Heydemann 1981).",
    only_by_name=True,
    judged_by="straight_line",
)
def grating_ripple(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Unequal sine and cosine of a grating leave a ripple with a weaker second harmonic."""
    periods = draws.each("periods", 1.8, 3.4)
    phase = 2 * np.pi * (periods * _share_again(signal, scene) + draws.each("phase", 0, 1))
    return signal + size * (np.sin(phase) + draws.each("second", 0.2, 0.5) * np.sin(2 * phase))


@form(
    Stage.ELECTRICAL,
    "Two patches on one strip that answer one after the other, with a flatter stretch between them (ours).",
    only_by_name=True,
    judged_by="straight_line",
)
def two_patches(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Each patch answers while the fold passes it; between them the strip hardly answers."""
    share = _share_again(signal, scene)
    width = draws.each("width", 0.06, 0.11)
    first = np.tanh((share - draws.each("first", 0.22, 0.34)) / width)
    second = np.tanh((share - draws.each("second", 0.62, 0.78)) / width)
    weight = draws.each("weight", 0.35, 0.65)
    return signal + size * (weight * first + (1 - weight) * second + 1 - 2 * share)


def _share_again(signal: np.ndarray, scene: Scene) -> np.ndarray:
    return (signal - scene.low) / scene.span


@form(
    Stage.ELECTRICAL,
    "Light through two polarisers that the joint turns: the squared cosine of their angle (Malus 1809).",
    only_by_name=True,
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
    only_by_name=True,
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
    only_by_name=True,
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


FORMS = (
    magnet_leaves,
    encoder_harmonics,
    printed_sections,
    loaded_potentiometer,
    grating_ripple,
    two_patches,
    two_polarisers,
    heavy_bits_off,
    arch_of_held_strip,
)
