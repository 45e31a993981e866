"""Postures as hands take them without being told: few synergies and some of each finger's own.

Santello, Flanders & Soechting 1998 found that two synergies (closing all fingers, and knuckles against
middle joints) carry most of the posture of grasping hands; spread, thumb opposition and single fingers
make the rest. The sizes are typical values.
"""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.hand_motion import PostureSequence, posture_vector, within_range
from glovecal_models.simulation.postures import POSTURES, TABLE_3_POSES
from glovecal_models.simulation.simulated_hand import DRIVEN, FINGERS

NAMED_SHARE = 0.35
"""How often a posture lies between two named ones instead of being made of synergies."""

LONGEST_STEP_S = 0.9
RETURN_S = 0.5


def free_motion(duration_s: float, random: np.random.Generator) -> PostureSequence:
    """Random postures for ``duration_s``, starting and ending at rest."""
    rest = posture_vector(POSTURES["rest"])
    postures, hold, move = [rest], [0.1], []
    while sum(hold) + sum(move) + LONGEST_STEP_S + RETURN_S < duration_s:
        postures.append(random_posture(random))
        move.append(random.uniform(0.25, LONGEST_STEP_S - 0.3))
        hold.append(random.choice([0.0, 0.0, 0.1, 0.3]))
    postures.append(rest)
    move.append(RETURN_S)
    hold.append(max(duration_s - sum(hold) - sum(move), 0.0))
    return PostureSequence(np.array(postures), [""] * len(postures), hold_s=hold, move_s=move, random=random)


def random_posture(random: np.random.Generator) -> np.ndarray:
    """One posture within the active ranges, shape (len(DRIVEN),), degrees."""
    if random.random() < NAMED_SHARE:
        first, second = random.choice(TABLE_3_POSES, 2)
        mix = random.random()
        between = mix * posture_vector(POSTURES[first]) + (1 - mix) * posture_vector(POSTURES[second])
        return within_range(between + 4 * random.standard_normal(len(DRIVEN)))
    return within_range(posture_vector(_from_synergies(random)))


def _from_synergies(random: np.random.Generator) -> dict[str, float]:
    close, hook, oppose = random.uniform(-0.1, 1), random.uniform(-0.4, 0.4), random.uniform(0, 1)
    posture = {}
    for finger in FINGERS:
        own = 0.2 * random.standard_normal()
        posture[f"{finger}_MCP"] = 90 * (close + own - hook)
        posture[f"{finger}_PIP"] = 100 * (close + own + hook)
    spread = random.uniform(0, 1) * (1 - 0.7 * max(close, 0))
    for pair in ("IM_ABD", "MR_ABD", "RP_ABD"):
        posture[pair] = 30 * spread + 3 * random.standard_normal()
    posture["T_TMC"] = 60 * oppose + 6 * random.standard_normal()
    posture["TI_ABD"] = 70 * random.uniform(0, 1) * (1 - 0.4 * close)
    posture["T_MCP"] = 50 * (0.6 * oppose + 0.4 * random.random())
    posture["T_IP"] = 80 * (0.5 * close + 0.5 * random.random())
    posture["W_FLEX"] = 25 - 50 * close + 20 * random.standard_normal()  # a closing hand extends the wrist
    posture["W_ABD"] = -4 + 10 * random.standard_normal()
    return posture
