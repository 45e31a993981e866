"""Palm arch: cupping the palm moves knuckles and cloth, so that sensors of the outer hand read otherwise.

The metacarpals of ring and little finger roll as they sink, cloth over the palm has slack to take up first,
and it is only held taut while the fingers are not closed over it.

The arch is a rotation of the hand that no sensor of the glove sees directly.

The cloth folds bit by bit, sticks to the palm, or is slackened by the finger's own bend.
"""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene

ARCH = "PALM_ARCH"


@form(
    Stage.MECHANICAL,
    "The arch pulls while fingers hold the cloth taut, little once they close: arch times opening (ours).",
    only_by_name=True,
    touches="palm",
)
def cupped_open_hand(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The arch counts the more the more open the hand is."""
    open_share = 1.0 - draws.one("closing_share", 0.8, 1.0) * scene.closing
    pull = scene.bent(ARCH) * open_share
    return signal + size * draws.sign() * 10.0 * (pull - 0.25)[:, :, None]


@form(
    Stage.MECHANICAL,
    "A metacarpal that rolls as it sinks swings its bent finger sideways: sine of arch times sine"
    " of bend (ours).",
    only_by_name=True,
    touches="palm",
)
def rolled_knuckle(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A straight finger does not notice the roll; one bent to a right angle is swung by all of it."""
    roll = np.deg2rad(draws.each("roll_per_arch", 0.8, 1.6) * scene.rotation(ARCH)[:, :, None])
    usual = np.sin(np.deg2rad(draws.each("usual_roll_deg", 12.0, 16.0)))
    return signal + size * draws.sign() * 20.0 * (np.sin(roll) - usual) * np.sin(np.deg2rad(scene.own))


@form(
    Stage.MECHANICAL,
    "The first degrees of arch only take up slack, those beyond pull ever more in proportion (toe"
    " of cloth; ours).",
    only_by_name=True,
    touches="palm",
)
def slack_across_palm(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Nothing until the slack is used up, then a straight line, with a round toe between."""
    arch = scene.rotation(ARCH)[:, :, None]
    slack = draws.each("slack_deg", 12.0, 17.0)
    toe = draws.one("toe_deg", 0.8, 2.0)
    return signal + size * draws.sign() * toe * np.logaddexp(0.0, (arch - slack) / toe)


@form(
    Stage.MECHANICAL,
    "Cloth across the back of the hand stiffens as it is stretched by the arch (J-curve; Fung 1967).",
    only_by_name=True,
    touches="palm",
)
def stiffening_cloth(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """An exponential of the arch, as of collagen and knit: soft at first, then stiff."""
    arch = scene.rotation("PALM_ARCH")[:, :, None]
    scale = draws.each("scale_deg", 5.0, 9.0)
    return signal + size * _side(scene, draws) * 0.3 * np.expm1(arch / scale)


@form(
    Stage.MECHANICAL,
    "The arch lifts the cloth off the knuckle and then draws it down again at its sides (ours).",
    only_by_name=True,
    touches="palm",
)
def lifts_then_draws_down(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A rise and fall over the arch, largest at a middling arch."""
    ratio = np.maximum(scene.rotation("PALM_ARCH"), 0)[:, :, None] / draws.each("peak_deg", 5.0, 9.0)
    return signal + size * _side(scene, draws) * ratio**2 * np.exp(1 - ratio**2)


@form(
    Stage.MECHANICAL,
    "Cupping moves the knuckle's crest sideways under the strip, which only a half-bent strip feels (ours).",
    only_by_name=True,
    touches="palm",
)
def crest_moves_sideways(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The arch times a bow over the own bend: nothing while straight or fully bent."""
    arch = scene.rotation("PALM_ARCH")[:, :, None] / 10
    bend = np.clip((signal - scene.low) / scene.span, 0, 1)
    top = draws.each("power", 0.7, 1.6)
    return signal + size * _side(scene, draws) * arch * np.sin(np.pi * bend**top)


def _side(scene: Scene, draws: Draws) -> np.ndarray:
    """The thumb's side of the arch moves the other way than the little finger's."""
    return draws.sign() * np.array([-1.0 if name.startswith("T") else 1.0 for name in scene.sensors])


@form(
    Stage.MECHANICAL,
    "Folds spring up across the palm one by one, each of which lets go what the arch has pulled (ours).",
    only_by_name=True,
    touches="palm",
)
def folds_one_by_one(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The pull rises with the arch and falls back at once whenever another fold springs up."""
    folds = draws.each("folds", 1.8, 3.5)
    first = draws.each("taken_before", 0.1, 0.6)
    taken = first + folds * scene.bent("PALM_ARCH")[:, :, None]
    return signal + size * 4 * draws.signs() * (taken % 1.0)


@form(
    Stage.MECHANICAL,
    "Damp cloth sticks to the palm and is taken along only once the arch has moved some way (Coulomb; ours).",
    only_by_name=True,
    touches="palm",
)
def sticks_to_palm(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The pull follows the arch behind a slack, whichever way the arch moves."""
    slack = draws.each("slack", 0.08, 0.2)
    arch = scene.bent("PALM_ARCH")[:, :, None]
    out = np.empty_like(signal)
    place = np.repeat(arch[:, 0], signal.shape[2], axis=1)
    for frame in range(signal.shape[1]):
        place = np.clip(place, arch[:, frame] - slack, arch[:, frame] + slack)
        out[:, frame] = place
    return signal + size * 4 * draws.signs() * out


@form(
    Stage.MECHANICAL,
    "A bent finger gives cloth to the palm, so only the arch beyond what it gave can pull (ours).",
    only_by_name=True,
    touches="palm",
)
def finger_gives_cloth(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The arch pulls only as far as it exceeds a share of the sensor's own bend."""
    given = draws.each("given", 0.3, 0.8)
    bend = np.clip((scene.own - scene.low) / scene.span, 0.0, 1.0)
    beyond = np.maximum(scene.bent("PALM_ARCH")[:, :, None] - given * bend, 0.0)
    return signal + size * 4 * draws.signs() * beyond


FORMS = (
    cupped_open_hand,
    rolled_knuckle,
    slack_across_palm,
    stiffening_cloth,
    lifts_then_draws_down,
    crest_moves_sideways,
    folds_one_by_one,
    sticks_to_palm,
    finger_gives_cloth,
)
