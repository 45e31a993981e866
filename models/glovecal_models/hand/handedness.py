"""Right or left, and what is of a hand."""

from __future__ import annotations

from typing import Any, Literal, get_args

Handedness = Literal["right", "left"]
HANDS: tuple[Handedness, ...] = get_args(Handedness)


def known_hand(said: Any) -> Handedness | None:
    """The hand that somebody named; None for anything else."""
    return next((hand for hand in HANDS if hand == said), None)


def is_of_hand(said: Any, wanted: Handedness | None) -> bool:
    """Whether a glove, take or model of which ``said`` is known may be of the hand that is ``wanted``: where
    nobody said it, of both. None wants either."""
    return wanted is None or known_hand(said) in (None, wanted)
