"""Nonlinearity: a curve over the own bend that is the same at every moment, and not straight.

Beyond one bow or one corner, real sensors show the steep law of a magnet that moves away, the waves of an
angle computed from two unequal channels, and the scallops of a strip made of several printed sections.
"""

from __future__ import annotations

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


FORMS = (magnet_leaves, encoder_harmonics, printed_sections)
