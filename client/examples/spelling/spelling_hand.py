"""The script of a hand that spells a text: a letter, the way to the next, the relaxed hand between words."""

from __future__ import annotations

import numpy as np
from stream.simulated_hand import Script

from glovecal_models.hand.rotations import HAND_ROTATIONS
from spelling.alphabet import LETTERS, LETTERS_DEG, REST_ANGLES_DEG

HELD_S, WAY_S, SPACE_S = 0.6, 0.35, 1.6


def spelling_hand(text: str) -> tuple[Script, float]:
    """The script and how long it takes. A letter that doubles is let go between.

    Raises ValueError for what is neither a static letter nor a space.
    """
    shapes, times, now = [REST_ANGLES_DEG], [0.0], 0.3
    for place, letter in enumerate(text.upper()):
        if letter != " " and letter not in LETTERS:
            raise ValueError(f"{letter!r} cannot be spelled; there are {LETTERS} and the space")
        shape = REST_ANGLES_DEG if letter == " " else LETTERS_DEG[LETTERS.index(letter)]
        if place and letter == text.upper()[place - 1] and letter != " ":
            now += WAY_S
            shapes.append(REST_ANGLES_DEG)
            times.append(now)
        hold_s = SPACE_S if letter == " " else HELD_S
        now += WAY_S
        shapes += [shape, shape]
        times += [now, now + hold_s]
        now += hold_s
    path = np.array(shapes)

    def script(seconds: float) -> dict[str, float]:
        angles = [float(np.interp(seconds, times, path[:, joint])) for joint in range(path.shape[1])]
        return dict(zip(HAND_ROTATIONS, angles, strict=True))

    return script, now + WAY_S
