"""Text from a stream of hands: a letter counts once, when it is held."""

from __future__ import annotations

import numpy as np
from stream.hand_stream import Hand

from spelling.nearest_letter import Nearest, nearest_letter

HOLD_S = 0.25
"""So long the nearest letter has to be the same."""
BETWEEN_S = 0.12
"""A letter comes again only after so long without it: letters that double are let go between."""
SPACE_S = 1.0
"""So long without a letter is a space between words."""
SMOOTHING_S = 0.08
"""Time constant of the mean over angles: a single frame is no shape."""
MOVING_DEG_PER_S = 60.0
"""Root mean square speed of the joints above which the hand is on its way, not in a letter."""


class Speller:
    """Follows one hand after another; ``text`` is what was spelled so far."""

    def __init__(self) -> None:
        self.text = ""
        self.nearest: Nearest | None = None
        self._before: Hand | None = None
        self._mean = np.empty(0)
        self._held, self._since = None, 0.0
        self._last: str | None = None
        self._last_seen = 0.0

    def follow(self, hand: Hand) -> str:
        """What this hand adds to the text: a letter, a space, mostly nothing."""
        speed = self._smooth(hand)
        self.nearest = nearest_letter(self._mean, hand.deviations_deg, hand.measured)
        letter = self.nearest.letter if speed < MOVING_DEG_PER_S else None
        if letter != self._held:
            self._held, self._since = letter, hand.seconds
        added = self._added(letter, hand.seconds)
        self.text += added
        return added

    def _added(self, letter: str | None, now_s: float) -> str:
        held_s = now_s - self._since
        if letter is not None and letter == self._last:
            self._last_seen = now_s
        elif self._last is not None and now_s - self._last_seen > BETWEEN_S:
            self._last = None
        if letter is None:
            return " " if held_s >= SPACE_S and self.text and not self.text.endswith(" ") else ""
        if held_s >= HOLD_S and letter != self._last:
            self._last, self._last_seen = letter, now_s
            return letter
        return ""

    def _smooth(self, hand: Hand) -> float:
        """Takes the hand into the mean; returns the RMS speed of its measured joints, degrees per second."""
        before, self._before = self._before, hand
        if before is None or not 0 < hand.seconds - before.seconds < 0.5:
            self._mean = hand.angles_deg
            return 0.0
        step_s = hand.seconds - before.seconds
        moved = (1 - np.exp(-step_s / SMOOTHING_S)) * (hand.angles_deg - self._mean)
        self._mean = self._mean + moved
        return float(np.sqrt(np.mean(moved[hand.measured] ** 2)) / step_s)
