"""The predicted hand beside the measured one as its ghost, in a stretch of a take."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any
from urllib.parse import quote

from nicegui import ui

from glovecal_service.studio.hand.hand_view import HandView, Side
from glovecal_service.studio.hand.replay import Replay
from glovecal_service.studio.service import Refusal, Service

SIDES: tuple[tuple[Side, str], ...] = (("back", "Back"), ("palm", "Palm"), ("side", "Side"))


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
        with ui.row().classes("glove-sides"):
            for side, name in SIDES:
                ui.button(name, on_click=partial(self._view.look, side)).props("outline no-caps").classes(
                    "studio-target"
                )
        self._replay = Replay(self._view)
        ui.label("Grey: predicted. Green, translucent: measured. Red: from fingertip to fingertip.")
        self._sentence = ui.label("").props('role="status"')

    async def of(self, subject: str) -> None:
        """The hand of this subject from now on."""
        if subject != self._subject:
            self._view.props["skeleton"] = await self._skeleton(subject)
            self._view.update()

    async def play(self, model: str, take: Mapping[str, Any], from_s: float, to_s: float) -> None:
        """``take``: as a series has it; seconds by its clock."""
        body = {"take": take["take"], "from_s": from_s, "to_s": to_s}
        try:
            answer = await self._service.post(f"/models/{model}/replay", body)
        except Refusal as refusal:
            self._sentence.set_text(str(refusal))
            return
        self._replay.show(answer, start_s=take["start_s"])
        self._sentence.set_text(answer["sentence"])

    async def _skeleton(self, subject: str) -> Mapping[str, Any]:
        self._subject = subject
        return await self._service.get(f"/subjects/{quote(subject)}/skeleton")
