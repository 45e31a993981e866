"""Plays a stretch of a take on one hand's view or two: predicted, with the measured hand as its ghost."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from nicegui.element import Element

from glovecal_service.studio.hand.hand_view import HandView


class Replay(Element, component="replay.js"):
    """Play, pause, a slider over the stretch, and the distance of each finger's tips in mm."""

    def __init__(self, hand: HandView, beside: HandView | None = None) -> None:
        """``beside``: shows another model's prediction of the same frames."""
        super().__init__()
        self._props["hand"] = hand.id
        self._props["other"] = None if beside is None else beside.id
        self._props["document"] = None
        self._props["beside"] = None

    def show(
        self, answer: Mapping[str, Any], *, start_s: float, beside: Mapping[str, Any] | None = None
    ) -> None:
        """An answer of ``POST /v1/models/{id}/replay``; ``start_s``: of the take, by its clock; ``beside``:
        the answer of the other hand's model."""
        self._props["beside"] = None if beside is None else dict(beside)
        self._props["document"] = {**answer, "start_s": start_s}
        self.update()
