"""The predicted hand beside the measured one as its ghost, in a stretch of a take."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any
from urllib.parse import quote

from nicegui import ui

from glovecal_models.comparison.series.answer import TakeSeries
from glovecal_service.rest.model.answer import ReplayView
from glovecal_service.studio.hand.hand_view import HandView, Replay, side_buttons
from glovecal_service.studio.service import Service, refusals


class ReplayedHand:
    """Of one subject at a time. Build it with ``await hand.build(subject)``."""

    def __init__(self, service: Service) -> None:
        self._service = service
        self._subject = ""

    async def build(self, subject: str) -> None:
        self._view = HandView(
            await self._skeleton(subject),
            label="Predicted hand, and the measured one as its ghost",
            seen_from="side",
            empty="Choose a stretch, or move cursor A",
        ).classes("compare-hand")
        side_buttons(self._view)
        self._replay = Replay(self._view)
        ui.label("Grey: predicted. Green, translucent: measured. Red: from fingertip to fingertip.")
        self._sentence = ui.label("").props('role="status"')

    async def of(self, subject: str) -> None:
        """The hand of this subject from now on."""
        if subject != self._subject:
            self._view.props["skeleton"] = await self._skeleton(subject)
            self._view.update()

    async def play(self, model: str, take: TakeSeries, from_s: float, to_s: float) -> None:
        """``take``: as a series has it; seconds by its clock."""
        body = {"take": take.take, "from_s": from_s, "to_s": to_s}
        with refusals(self._sentence.set_text):
            answer = await self._service.ask(ReplayView, f"/models/{model}/replay", body)
            self._replay.show(answer, start_s=take.start_s)
            self._sentence.set_text(answer.sentence)

    async def _skeleton(self, subject: str) -> Mapping[str, Any]:
        self._subject = subject
        return await self._service.get(f"/subjects/{quote(subject)}/skeleton")
