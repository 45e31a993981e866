"""The script of a hand whose index and middle finger walk, as a person does it on a desk."""

from __future__ import annotations

import numpy as np

from glovecal_models.hand.rotations import HAND_ROTATIONS, completed
from walking.figure import STAND_S

STANCE_DEG, SWING_DEG = 45.0, 17.0
"""Of the knuckle while standing, and how far it goes to both sides of that."""
KNEE_DEG, RAISED_DEG = 10.0, 55.0
"""Of the middle joint: on the ground, and what is added in the middle of a swing."""
STEP_S = 0.6
AIR_SHARE = 0.45
"""Of a finger's cycle that it is in the air."""


def walking_fingers(steps: int, still_s: float = STAND_S + 0.5):
    """A script (angles by rotation at a time in seconds): stand, make that many steps, stand."""

    def script(seconds: float) -> dict[str, float]:
        walked = float(np.clip((seconds - still_s) / STEP_S, 0.0, steps))
        bends = {"T_MCP": 30.0, "T_IP": 40.0, "TI_ABD": 10.0, "IM_ABD": 0.0, "W_FLEX": 0.0, "W_ABD": 0.0}
        bends |= {f"{finger}_{joint}": 85.0 for finger in "RP" for joint in ("MCP", "PIP")}
        bends |= {"MR_ABD": 0.0, "RP_ABD": 0.0, "T_TMC": 35.0}
        for leg, finger in enumerate("IM"):
            swing, raised = _leg(walked, leg, steps)
            bends[f"{finger}_MCP"] = STANCE_DEG - SWING_DEG * swing - 0.35 * RAISED_DEG * raised
            bends[f"{finger}_PIP"] = KNEE_DEG + RAISED_DEG * raised
        angles = completed(list(bends), np.array([list(bends.values())]))[0]
        return dict(zip(HAND_ROTATIONS, angles.tolist(), strict=True))

    return script


def lasts_s(steps: int) -> float:
    """A second of standing after the last step is in it."""
    return STAND_S + 0.5 + steps * STEP_S + 1.0


def _leg(walked: float, leg: int, steps: int) -> tuple[float, float]:
    """How far in front a finger is (-1 to 1), and how far raised (0 to 1).

    Steps alternate, index first. A foot in front goes back while the other one swings; the last step of each
    leg ends beside the other.
    """
    whole = min(int(walked), steps - 1)
    share = walked - whole
    mine = [step for step in range(steps) if step % 2 == leg]
    if whole in mine:
        begin, end = _place(whole, steps, swinging=True)
        in_air = np.clip((share - (1 - 2 * AIR_SHARE) / 2) / (2 * AIR_SHARE), 0.0, 1.0)
        return float(begin + (end - begin) * (1 - np.cos(np.pi * in_air)) / 2), float(
            np.sin(np.pi * in_air) ** 2
        )
    begin, end = _place(whole, steps, swinging=False)
    return begin + (end - begin) * share, 0.0


def _place(step: int, steps: int, swinging: bool) -> tuple[float, float]:
    """Where a finger is at the beginning and the end of a step."""
    begin = 0.0 if step == 0 else (-1.0 if swinging else 1.0)
    end = 0.0 if step == steps - 1 else (1.0 if swinging else -1.0)
    return begin, end
