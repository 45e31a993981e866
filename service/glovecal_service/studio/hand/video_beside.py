"""A take's video beside a hand in three dimensions that has the pose of the same moment."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from nicegui.element import Element

from glovecal_service.studio.hand.hand_view import HandView

ROOT = "/v1"


class VideoBeside(Element, component="video_beside.js"):
    """Play, pause, picture by picture, and a slider; nothing before ``show``."""

    def __init__(self, hand: HandView) -> None:
        super().__init__()
        self._props["hand"] = hand.id
        self._props["root"] = ROOT
        self._props["video"] = None
        self._props["hands"] = None

    def show(self, video: Mapping[str, Any] | None, hands: Mapping[str, Any] | None) -> None:
        """Answers of ``GET /v1/videos/{id}`` and of its ``hand``; the moment stays where the video does."""
        self._props["video"] = None if video is None else dict(video)
        self._props["hands"] = None if hands is None else dict(hands)
        self.update()
