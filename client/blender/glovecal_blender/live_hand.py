"""One glove's hand, live: its poses become turns of an armature's bones in a thread of its own.

Nothing here touches Blender: what the main thread has to do for a frame is to take the newest turns.
"""

from __future__ import annotations

import threading
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import zenoh

from glovecal_client import PoseSubscriber
from glovecal_client.errors import NoAnswer
from glovecal_client.wire.pose import Pose
from glovecal_models.errors import BadInput
from glovecal_models.hand.bones import HandBones
from glovecal_models.hand.retargeting.touches import Touches
from glovecal_models.hand.rotations import HeldAngles
from glovecal_models.hand.skeleton import Skeleton, skeleton_from_document

MOST_RECORDED = 1_000_000
"""Poses of a recording: two hours at 120 Hz."""
WAIT_S = 0.25


@dataclass(frozen=True)
class BoneTurns:
    """Of M bones, at one moment of the hand."""

    time_ns: int
    """By the capture computer's monotonic clock."""
    run: int
    """Of the capture: times of two runs are not compared."""
    quaternions: np.ndarray
    """(M, 4) w, x, y, z: from the rest pose, in each bone's own axes."""
    sd_deg: np.ndarray
    """(M,) the largest standard deviation of the rotations that turn the bone; NaN where none does."""
    usable: np.ndarray
    """(M,) bool: the pose is live, no rotation of the bone too uncertain or of a failing sensor."""


class LiveHand:
    """Close it before its session."""

    def __init__(self, session: zenoh.Session, site: str, glove: str) -> None:
        """Raises BadName."""
        self.glove = glove
        self.sentence = "No pose has come yet."
        """What there is to say of this hand."""
        self.skeleton: Skeleton | None = None
        """Known with the first pose of a model."""
        self.latest: BoneTurns | None = None
        self.touches: Touches | None = None
        """What the bones follow by."""
        self._weights = np.empty((0, 0))
        self._held = HeldAngles()
        self._meta: object = None
        self.recording: list[BoneTurns] | None = None
        """Every pose since ``record``; None while nothing is recorded."""
        self._poses = PoseSubscriber(session, site, glove)
        self._thread = threading.Thread(target=self._run, name=f"glovecal {glove}", daemon=True)
        self._closing = False
        self._thread.start()

    def follow(self, touches: Touches | None) -> None:
        """Onto which bones; None: onto none."""
        if touches is not None:
            self._weights = rotations_of(touches.retargeting.bones)[list(touches.retargeting.segments)]
        self.touches, self.latest = touches, None

    @property
    def names(self) -> tuple[str, ...]:
        """The armature's bones that turn."""
        return () if self.touches is None else self.touches.retargeting.names

    def record(self) -> None:
        self.recording = []

    def recorded(self) -> list[BoneTurns]:
        """What was recorded; recording ends."""
        recorded, self.recording = self.recording or [], None
        return recorded

    def counts(self) -> str:
        """Poses that came and that did not, a line."""
        counts = self._poses.counts
        return f"{counts.received} poses, {counts.skipped} skipped, {counts.lost} lost"

    def close(self) -> None:
        self._closing = True
        self._thread.join()
        self._poses.close()

    def _run(self) -> None:
        while not self._closing:
            pose = self._poses.wait(WAIT_S)
            if pose is not None:
                self._take(pose)
            elif self._poses.stale and self.latest is not None:
                self._say_not_live("Stale: no pose for half a second.")

    def _take(self, pose: Pose) -> None:
        if pose.uncalibrated:
            self._say_not_live("Uncalibrated: no model is active for who wears the glove.")
            return
        try:
            meta = self._poses.meta(pose)
            if meta is not self._meta:
                self.skeleton = skeleton_from_document(meta.get("skeleton"))
                self._held, self._meta = HeldAngles(), meta
        except (NoAnswer, BadInput) as error:
            self._say_not_live(str(error))
            return
        self.sentence = ", ".join(pose.words) or "Live."
        touches = self.touches
        if touches is None or self.skeleton is None:
            return
        usable = pose.usable
        rotations = tuple(str(name) for name in meta["rotations"])
        angles = np.array([self._held.degrees(self.skeleton.rotations, rotations, pose.degrees, usable)])
        made = touches.retargeting
        turns = made.from_rest(made.against_parents(touches.orientations(angles)))[0]
        self.latest = latest = BoneTurns(
            pose.monotonic_ns, pose.run_id, quaternions(turns), self._deviations(rotations, pose),
            self._usable(rotations, pose),
        )  # fmt: skip
        recorded = self.recording
        if recorded is not None and not pose.stale and len(recorded) < MOST_RECORDED:
            recorded.append(latest)

    def _say_not_live(self, sentence: str) -> None:
        self.sentence, latest = sentence, self.latest
        if latest is not None:
            self.latest = replace(latest, usable=np.zeros(len(latest.usable), bool))

    def _usable(self, rotations: Sequence[str], pose: Pose) -> np.ndarray:
        assert self.skeleton is not None
        bad = {name for name, is_usable in zip(rotations, pose.usable, strict=True) if not is_usable}
        is_bad = np.array([name in bad for name in self.skeleton.rotations])
        unusable = np.any(self._weights & is_bad, axis=1)
        return np.logical_not(unusable | pose.stale)

    def _deviations(self, rotations: Sequence[str], pose: Pose) -> np.ndarray:
        assert self.skeleton is not None
        by_name = dict(zip(rotations, pose.deviations.tolist(), strict=True))
        sd_deg = np.array([by_name.get(name, np.nan) for name in self.skeleton.rotations])
        turned_by = np.where(self._weights & np.isfinite(sd_deg), sd_deg, -1.0).max(axis=1)
        return np.where(turned_by < 0, np.nan, turned_by)


def rotations_of(bones: HandBones) -> np.ndarray:
    """(B, R) bool: which rotations turn a bone against the one before it."""
    skeleton = bones.skeleton
    own = np.zeros((len(bones.names), len(skeleton.rotations)), bool)
    for bone, (last, parent) in enumerate(zip(bones.joints, bones.parents, strict=True)):
        above = None if parent is None else bones.joints[parent]
        joint: int | None = last
        while joint is not None and joint != above:
            own[bone] |= skeleton.weights[joint] != 0
            joint = skeleton.parents[joint]
    return own


def quaternions(matrices: np.ndarray) -> np.ndarray:
    """(M, 4) w, x, y, z of turns (M, 3, 3); of the four ways to read one, that which divides by most."""
    m = matrices.transpose(1, 2, 0)
    trace = m[0, 0] + m[1, 1] + m[2, 2]
    ways = np.stack(
        [
            [1 + trace, m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]],
            [m[2, 1] - m[1, 2], 1 + 2 * m[0, 0] - trace, m[0, 1] + m[1, 0], m[0, 2] + m[2, 0]],
            [m[0, 2] - m[2, 0], m[0, 1] + m[1, 0], 1 + 2 * m[1, 1] - trace, m[1, 2] + m[2, 1]],
            [m[1, 0] - m[0, 1], m[0, 2] + m[2, 0], m[1, 2] + m[2, 1], 1 + 2 * m[2, 2] - trace],
        ]
    )
    best = np.argmax(ways[range(4), range(4)], axis=0)
    chosen = ways[best, :, np.arange(len(best))]
    return chosen / np.linalg.norm(chosen, axis=1, keepdims=True)
