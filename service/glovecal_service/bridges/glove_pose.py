"""A pose on its way through a bridge: with names of its rotations, whose hand it is, and what it is worth."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from glovecal_client.wire.pose import Pose
from glovecal_models.errors import BadInput
from glovecal_models.hand.bones import HandBones
from glovecal_models.hand.rotations import Handedness, HeldAngles, known_hand
from glovecal_models.hand.skeleton import Quaternion, Skeleton, skeleton_from_document
from glovecal_service.bridges.bone_turns import BoneTurns

PoseState = Literal["live", "stale", "uncalibrated"]


class PoseMeaning:
    """What ``pose/meta`` says of a model's poses. Raises BadInput where rotations have no names."""

    def __init__(self, document: Mapping[str, Any]) -> None:
        self.document = document
        self.rotations = tuple(str(name) for name in document["rotations"])
        self.hand: Handedness | None = known_hand(document.get("hand"))
        self.skeleton: Skeleton | None = None
        """None where nobody said which hand it is, or what was said is no skeleton."""
        self.problem = ""
        """Why the bones are not known, a sentence."""
        if document.get("skeleton") is None:
            if self.rotations:
                subject = document.get("subject") or "SUBJECT"
                self.problem = (
                    "nobody said which hand it is on, so its bones are not known; say so: "
                    f"glovecal subject measure {subject} --hand right"
                )
        else:
            try:
                self.skeleton = skeleton_from_document(document["skeleton"])
            except BadInput as error:
                self.problem = str(error)


@dataclass(frozen=True)
class GlovePose:
    glove: str
    pose: Pose
    meaning: PoseMeaning
    arrived_ns: int
    """When it reached this process, ``clock_ns``."""
    is_of_this_computer: bool
    """Whether its time is by this computer's monotonic clock."""

    @property
    def state(self) -> PoseState:
        return "stale" if self.pose.stale else "uncalibrated" if self.pose.uncalibrated else "live"

    @property
    def radians(self) -> dict[str, float]:
        """The usable angles by rotation."""
        angles = np.radians(self.pose.degrees.astype(float)).tolist()
        return {
            name: angle
            for name, angle, is_usable in zip(
                self.meaning.rotations, angles, self.pose.usable.tolist(), strict=True
            )
            if is_usable
        }


class BonesInMotion:
    """The bones of one glove's hand as its poses come.

    An angle that is not usable keeps its last usable value; what was never usable follows a rule, or rests.
    """

    def __init__(self) -> None:
        self._held = HeldAngles()
        self._model: str | None = None
        self._turns: BoneTurns | None = None

    def turned(self, hand: GlovePose) -> tuple[HandBones, list[Quaternion]] | None:
        """The bones, and how each is turned in its parent's frame; None where it is not known which hand the
        glove is on."""
        skeleton, pose = hand.meaning.skeleton, hand.pose
        if skeleton is None:
            return None
        if self._turns is None or self._turns.bones.skeleton is not skeleton:
            self._turns = BoneTurns(HandBones.of(skeleton))
        if pose.model_sha256 != self._model:
            self._held, self._model = HeldAngles(), pose.model_sha256
        degrees = self._held.degrees(skeleton.rotations, hand.meaning.rotations, pose.degrees, pose.usable)
        return self._turns.bones, self._turns.local(degrees)
