"""Exact accounting of a stream of poses: what came, what never came, what the service skipped."""

from __future__ import annotations

from dataclasses import dataclass

from glovecal_client.plausible_loss import PlausibleLoss
from glovecal_client.wire.pose import Pose

_BEGINS_AGAIN = 3
"""Poses in a row."""


@dataclass(frozen=True)
class PoseCounts:
    """What a subscriber has seen since it started."""

    received: int = 0
    """Poses taken, one per frame."""
    skipped: int = 0
    """Frames the service says it skipped, on purpose, to stay current."""
    lost: int = 0
    """Frames with neither a pose nor a skip: lost between the service and here, or before the service."""
    repeated: int = 0
    """Poses for a frame that was already shown or overtaken; ignored."""
    damaged: int = 0
    """Messages that were no whole pose; ignored."""
    runs: int = 0
    """Starts of the capture daemon seen, 1 in an undisturbed session."""


class PoseOrder:
    """Sorts poses into new ones and repeated ones, and counts. Not for several threads at once."""

    def __init__(self) -> None:
        self._last: Pose | None = None
        self._again: list[int] = []
        self._received = self._skipped = self._gaps = self._repeated = self._damaged = self._runs = 0

    def accept(self, pose: Pose) -> bool:
        """Whether the pose is to be shown: newer than all before, or a first notice that it is stale."""
        last = self._last
        if last is None or pose.run_id != last.run_id:
            self._runs += 1
            if pose.stale:  # a repetition of a frame from before this subscriber listened
                self._last = pose
                return True
        elif pose.sequence == last.sequence and pose.stale and not last.stale:
            self._last = pose
            return True
        elif pose.sequence <= last.sequence and not self._begins_again(pose):
            self._repeated += 1
            return False
        else:
            self._note_gap(last, pose)
        self._again.clear()
        self._received += 1
        self._last = pose
        return True

    def _begins_again(self, pose: Pose) -> bool:
        """Whether the glove's numbers went on from a lower one: a few poses in a row, each above the last.

        The service lets no lower number pass otherwise, so poses that were overtaken do not come like that.
        """
        if pose.stale or (self._again and pose.sequence <= self._again[-1]):
            self._again.clear()
        if not pose.stale:
            self._again.append(pose.sequence)
        return len(self._again) >= _BEGINS_AGAIN

    def _note_gap(self, last: Pose, pose: Pose) -> None:
        """Count the frames between two poses, unless the glove's numbers jumped."""
        between = pose.sequence - last.sequence - 1
        if between >= 0 and PlausibleLoss(last.monotonic_ns).allows(between, pose.monotonic_ns):
            self._gaps += between
            self._skipped += max(0, pose.skipped - last.skipped)

    def note_damage(self) -> None:
        """Count a message that could not be decoded."""
        self._damaged += 1

    def counts(self) -> PoseCounts:
        """The counts of this moment."""
        lost = max(0, self._gaps - self._skipped)
        return PoseCounts(self._received, self._skipped, lost, self._repeated, self._damaged, self._runs)
