"""A recording followed forwards and backwards: neither trails behind the motion then.

Wang & Popovic 2009, section 5.4, expects a hand where it was; so answers come late while it moves, by 15 to
20 ms. Followed backwards they come as much too early: between both there is no lag, and where both answers
differ, the picture left the pose open.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import islice
from typing import Protocol

import numpy as np

from glovecal_models.colour_glove.hand_state import PoseEstimate
from glovecal_models.colour_glove.pose.hand_tracker import ACCEPTED_SD_DEG

AHEAD, AT_ONCE = 15, 150
"""Pictures from which a way back begins beyond those it is wanted for, and how many are held at a time."""

Moment = tuple[Sequence[np.ndarray], float]
"""Label images, one of each camera, and when they were taken, in seconds."""


class Follows(Protocol):
    """As ``HandTracker`` does."""

    def track(self, label_images: Sequence[np.ndarray], seconds: float) -> PoseEstimate | None: ...
    def forget(self) -> None: ...


def followed_both_ways(
    forwards: Follows, backwards: Follows, moments: Iterable[Moment]
) -> Iterator[PoseEstimate | None]:
    """Poses of ``moments``, in their order. The two trackers are alike and have seen nothing yet.

    Raises what they raise.
    """
    rest = iter(moments)
    held, ahead = [], []
    while True:
        more = list(islice(rest, AT_ONCE + AHEAD - len(held)))
        ahead += [forwards.track(labels, seconds) for labels, seconds in more]
        held += more
        count = len(held) if len(held) < AT_ONCE + AHEAD else AT_ONCE
        backwards.forget()
        back: list[PoseEstimate | None] = [
            backwards.track(labels, -seconds) for labels, seconds in reversed(held)
        ]
        back.reverse()
        yield from (_between(*both) for both in zip(ahead[:count], back[:count], strict=True))
        held, ahead = held[count:], ahead[count:]
        if not held:
            return


def _between(forward: PoseEstimate | None, backward: PoseEstimate | None) -> PoseEstimate | None:
    """Half of the way from one to the other."""
    if forward is None or backward is None:
        return forward or backward
    step = backward.state.step_from(forward.state)
    shares = backward.standard_deviation**2 + forward.standard_deviation**2
    share = forward.standard_deviation**2 / shares
    deviation = np.sqrt(0.5 * shares + 0.25 * step**2)
    return replace(
        forward,
        state=forward.state.moved(share * step),
        standard_deviation=deviation,
        accepted=deviation[:20] <= ACCEPTED_SD_DEG,
        patches=tuple(sorted({*forward.patches, *backward.patches})),
        disagreeing=max(forward.disagreeing, backward.disagreeing),
    )
