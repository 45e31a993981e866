"""Palm arch: cupping the palm moves knuckles and cloth, so that sensors of the outer hand read otherwise.

The metacarpals of ring and little finger roll as they sink, cloth over the palm has slack to take up first,
and it is only held taut while the fingers are not closed over it.
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


FORMS = (cupped_open_hand, rolled_knuckle, slack_across_palm)
