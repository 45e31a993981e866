"""``skeleton``: a hand of usual size, for viewers of a glove that nobody is known to wear."""

from __future__ import annotations

from typing import Any

from fastapi import APIRouter

from glovecal_models.hand.rotations import Handedness
from glovecal_models.hand.skeleton import hand_skeleton, skeleton_document
from glovecal_service.rest.http.problem import problems
from glovecal_service.rest.subject.answer import SkeletonView

router = APIRouter(prefix="/skeleton", tags=["subjects"])


@router.get(
    "", response_model=SkeletonView, summary="A hand of usual size, for viewers", responses=problems()
)
def get_usual_skeleton(hand: Handedness = "right") -> dict[str, Any]:
    """As a subject's skeleton, where nothing was measured."""
    return skeleton_document(hand_skeleton(hand=hand))
