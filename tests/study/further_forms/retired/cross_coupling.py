"""Cross-coupling: the bend of other joints moves a sensor's reading, at once and whatever their past.

Cloth spans several knuckles, seams run across the back of the hand, and sensors wired as a matrix are read
through each other.

Cloth between two joints is one piece: it has a length to share out, threads across it, and a tautest one.

Through a return wire that all share, through a magnet that comes alongside, and through a web with slack.
"""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene


@form(
    Stage.MECHANICAL,
    "A band over several knuckles is lifted by the neighbour that is bent most (largest of two; ours).",
    only_by_name=True,
    touches="two",
)
def tallest_knuckle(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Only the neighbour that is bent more counts; the other one lies in its shade."""
    before, after = _neighbours((scene.own - scene.low) / scene.span)
    weight = draws.each("weight_after", 0.7, 1.3)
    lifted = np.maximum(before, weight * after)
    return signal + size * draws.signs() * 10.0 * (lifted - 0.5)


@form(
    Stage.MECHANICAL,
    "A seam from joint to joint runs aslant once they part, whichever is ahead (Pythagoras; ours).",
    only_by_name=True,
    touches="two",
)
def seam_runs_aslant(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The seam lengthens with the square of the joints' difference, and in proportion where that is large."""
    bent = (scene.own - scene.low) / scene.span
    other = _neighbours(bent)[1]
    apart = (bent - other) / draws.each("seam_length", 0.15, 0.4)
    return signal + size * draws.signs() * 5.0 * (np.sqrt(1 + np.square(apart)) - 1)


@form(
    Stage.ELECTRICAL,
    "A sneak path through two neighbours in series lies parallel to a sensor read in a matrix"
    " (crossbar readout).",
    only_by_name=True,
    touches="two",
)
def sneak_path(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The conductance of two neighbours one behind the other is added to the own one."""
    conductance = np.maximum(scene.counts_zero_deg + signal, 3.0)
    before, after = _neighbours(conductance)
    path = before * after / (before + after)
    usual = np.maximum(scene.counts_zero_deg + scene.low + 0.4 * scene.span, 3.0)
    one, two = _neighbours(usual)
    return signal + size * 0.3 * (path - one * two / (one + two))


def _neighbours(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The values of the sensors listed before and after each; the last and the first are neighbours too."""
    return np.roll(values, 1, axis=-1), np.roll(values, -1, axis=-1)


@form(
    Stage.MECHANICAL,
    "Only the more bent of two neighbours pulls, as the tautest thread carries all (ours).",
    only_by_name=True,
    touches="two",
)
def tautest_thread(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The larger of two neighbours' bends, each with its own lever, pulls at the sensor."""
    one, other = _neighbours_again(scene)
    lever = draws.each("lever", 0.7, 1.4)
    return signal + size * draws.sign() * 2 * (np.maximum(one, lever * other) - 0.4)


@form(
    Stage.MECHANICAL,
    "A thread from base to tip spans two joints: the chord of three links in a chain (plane geometry; ours).",
    only_by_name=True,
    touches="two",
)
def chord_of_two_joints(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """How far the neighbour's bend shortens the chord, beyond what it does at its usual bend."""
    one, _ = _neighbours_again(scene)
    links = draws.each("middle", 0.6, 1.2), draws.each("last", 0.6, 1.2)
    own = np.radians(scene.own)

    def chord(neighbour: np.ndarray) -> np.ndarray:
        folded = links[0] * np.exp(1j * own) + links[1] * np.exp(1j * (own + np.radians(95 * neighbour)))
        return np.abs(1 + folded)

    usual = np.full_like(one, 0.35)
    return signal + size * draws.sign() * 3 * (chord(usual) - chord(one))


@form(
    Stage.MECHANICAL,
    "Own and neighbouring bends draw on one stock of cloth; beyond it all pull at each other (ours).",
    only_by_name=True,
    touches="two",
)
def stock_of_cloth(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """What three joints together ask for beyond the stock of loose cloth, with a soft corner."""
    one, other = _neighbours_again(scene)
    weight = draws.each("weight", 0.2, 0.8)
    asked = 0.6 * _bends(scene) + 1.4 * (weight * one + (1 - weight) * other)
    soft = draws.one("soft", 0.05, 0.12)
    return signal - size * 3 * soft * np.logaddexp(0, (asked - draws.each("stock", 0.7, 1.0)) / soft)


def _bends(scene: Scene) -> np.ndarray:
    """Every sensor's own bend as a share of its range."""
    return (scene.own - scene.low) / scene.span


def _neighbours_again(scene: Scene) -> tuple[np.ndarray, np.ndarray]:
    """The bends of the two sensors nearest in the glove's order, each (T, N, S)."""
    bends, count = _bends(scene), len(scene.sensors)
    nearest = [
        sorted((k for k in range(count) if k != i), key=lambda k, i=i: abs(k - i)) for i in range(count)
    ]
    return bends[:, :, [order[0] for order in nearest]], bends[
        :, :, [order[-1 if len(order) < 2 else 1] for order in nearest]
    ]


@form(
    Stage.ELECTRICAL,
    "Currents of all other sensors lift the ground of a shared return wire (common-impedance coupling; Ott).",
    only_by_name=True,
    touches="two",
)
def shared_return_wire(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Each sensor is lifted by the others' currents, which fall as they bend, less so when bent itself."""
    growth = draws.each("growth", 1.0, 3.0)
    bend = _bend(scene.own, scene)
    current = 1 / (1 + growth * bend)
    others = current.sum(axis=2, keepdims=True) - current
    lift = others - (bend.shape[2] - 1) / (1 + 0.4 * growth)
    return signal + size * 4 * lift * (1 - draws.one("own_share", 0.3, 0.7) * bend)


@form(
    Stage.ELECTRICAL,
    "A neighbour's magnet adds its field while both fingers are side by side (dipole: inverse cube).",
    only_by_name=True,
    touches="two",
)
def magnet_alongside(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Each sensor is disturbed while it and its neighbour are about equally bent, not when they part."""
    reach = draws.each("reach", 0.12, 0.3)
    apart = _bend(scene.own, scene) - _neighbour(_bend(scene.own, scene))
    return signal + size * 4 * draws.signs() * (1 + (apart / reach) ** 2) ** -1.5


@form(
    Stage.MECHANICAL,
    "A web of cloth follows the neighbour with slack, so it rests until that is taken up (backlash; ours).",
    only_by_name=True,
    touches="two",
)
def slack_web(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Each sensor is pulled by a web that its neighbour drags along behind a slack in both directions."""
    slack = draws.each("slack", 0.1, 0.25)
    bend = _neighbour(_bend(scene.own, scene))
    dragged = np.empty_like(bend)
    place = bend[:, 0]
    for frame in range(bend.shape[1]):
        place = np.clip(place, bend[:, frame] - slack, bend[:, frame] + slack)
        dragged[:, frame] = place
    return signal + size * 4 * draws.signs() * dragged


def _bend(angle: np.ndarray, scene: Scene) -> np.ndarray:
    return np.clip((angle - scene.low) / scene.span, 0.0, 1.1)


def _neighbour(values: np.ndarray) -> np.ndarray:
    """The next sensor's values for each sensor; the last one takes those before it."""
    place = np.arange(values.shape[2])
    return values[:, :, np.where(place + 1 < len(place), place + 1, place - 1)]


FORMS = (
    tallest_knuckle,
    seam_runs_aslant,
    sneak_path,
    tautest_thread,
    chord_of_two_joints,
    stock_of_cloth,
    shared_return_wire,
    magnet_alongside,
    slack_web,
)
