"""Poses of a glove that is served with a delay: each waits for the frames after it, and is told by them too.

They are those of the same frames as a recorded take, estimated with that delay. A frame is due with the first
one that is the delay later by the glove's own times; where none comes any more, what is known has to do.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from glovecal_client.wire.frame import Frame
from glovecal_client.wire.pose import PoseFlag
from glovecal_models.calibration.fixed_lag import CLOCK_S, FixedLagSmoother
from glovecal_models.calibration.predictor import GloveAngles
from glovecal_models.effects.base.dynamics import LONGEST_GAP_S
from glovecal_service.realtime.frame_record import Effects
from glovecal_service.realtime.served_model import ServedModel

NO_FRAME_NS = 500_000_000
"""Beyond the delay, without a frame: then poses that wait go out, before the last one is marked as stale."""
_RESET = int(PoseFlag.STATE_RESET)


class LiveFrame(NamedTuple):
    """A frame with what it would be without a delay."""

    frame: Frame
    received_ns: int
    angles: GloveAngles
    """Of this frame alone."""
    flags: int
    """Of the pose, as far as the effects say them."""


class DelayedPoses:
    """One glove with one model. Belongs to the predicting thread."""

    def __init__(self, model: ServedModel, delay_ns: int) -> None:
        self.model, self.delay_ns = model, delay_ns
        self._smoother = FixedLagSmoother(len(model.rotations))
        self._waiting: deque[tuple[LiveFrame, np.ndarray]] = deque()
        """With (1, R), degrees squared: what its live claim has for parts that are smoothed."""
        self._newest: LiveFrame | None = None

    def __len__(self) -> int:
        """Poses that wait."""
        return len(self._waiting)

    def add(self, live: LiveFrame, effects: Effects | None) -> tuple[list[LiveFrame], GloveAngles | None]:
        """The next frame, and what its model's ``effects`` did; frames whose poses are due, with their
        angles, None where there are none."""
        earlier, newest = self._newest, live.frame
        due: list[LiveFrame] = []
        angles: list[GloveAngles] = []
        if earlier is not None and _begins_anew(earlier.frame, live):
            due, rest = self.rest()
            angles = [] if rest is None else [rest]
            self._smoother = FixedLagSmoother(len(self.model.rotations))
        correction = np.zeros_like(live.angles.mean) if effects is None else effects.correction
        parts = () if effects is None else effects.parts.found
        late = self.model.smoothing.late(live.angles, correction, parts)
        self._smoother.add(newest.monotonic_ns / 1e9, late.degrees[0], late.known[0])
        self._newest = live
        self._waiting.append((live, late.claimed))
        ends: list[int] = []
        for waiting, _ in self._waiting:
            left_s = (waiting.frame.monotonic_ns + self.delay_ns - newest.monotonic_ns) / 1e9
            if left_s > CLOCK_S:
                break
            ends.append(self._smoother.frames - (1 if left_s >= -CLOCK_S else 2))
        more, estimated = self._take(ends)
        return [*due, *more], _together([*angles, *([] if estimated is None else [estimated])])

    def rest(self, now_ns: int | None = None) -> tuple[list[LiveFrame], GloveAngles | None]:
        """All that wait, estimated with what is known; ``now_ns``: only where no frame came for too long."""
        newest_ns = 0 if self._newest is None else self._newest.received_ns
        if now_ns is not None and now_ns - newest_ns < self.delay_ns + NO_FRAME_NS:
            return [], None
        return self._take([self._smoother.frames - 1] * len(self._waiting))

    def _take(self, ends: Sequence[int]) -> tuple[list[LiveFrame], GloveAngles | None]:
        """The oldest frames that wait, estimated by those up to ``ends``."""
        if not ends:
            return [], None
        first = self._smoother.frames - len(self._waiting)
        taken = [self._waiting.popleft() for _ in ends]
        motion = self._smoother.estimates(first + np.arange(len(ends)), np.array(ends))
        self._smoother.forget(first + len(ends))
        live = _together([item.angles for item, _ in taken])
        assert live is not None
        claimed = np.concatenate([claimed for _, claimed in taken])
        return [item for item, _ in taken], self.model.smoothing.angles(live, claimed, motion)


def _begins_anew(earlier: Frame, live: LiveFrame) -> bool:
    frame, elapsed_s = live.frame, (live.frame.monotonic_ns - earlier.monotonic_ns) / 1e9
    is_reset = bool(live.flags & _RESET)
    return frame.run_id != earlier.run_id or is_reset or not 0.0 <= elapsed_s <= LONGEST_GAP_S


def _together(angles: Sequence[GloveAngles]) -> GloveAngles | None:
    if len(angles) < 2:
        return angles[0] if angles else None
    return GloveAngles(
        *(np.concatenate([getattr(one, name) for one in angles]) for name in ("mean", "sd", "flags"))
    )
