"""One glove on the Live page."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from functools import partial
from typing import Any
from urllib.parse import quote

from nicegui import ui

from glovecal_service.studio.amounts import version_name
from glovecal_service.studio.glove_state import GloveState
from glovecal_service.studio.hand.hand_view import HandView, Side
from glovecal_service.studio.heading import heading
from glovecal_service.studio.service import Refusal
from glovecal_service.studio.strips.live_values import AngleList, SensorStrips
from glovecal_service.studio.studio import Studio

SIDES: tuple[tuple[Side, str], ...] = (("back", "Back"), ("palm", "Palm"), ("side", "Side"))


class GloveCard:
    """State, hand, angles and readings; another model of the wearer is served from the next frame on."""

    def __init__(self, studio: Studio, glove: str) -> None:
        self._studio = studio
        self._glove = glove

    async def build(self) -> None:
        feed = f"/studio/feed/{quote(self._glove)}"
        glove = await self._seen()
        with ui.element("section").classes("glove") as section:
            section.props["aria-label"] = f"Glove {self._glove}"
            with ui.row().classes("glove-head"):
                heading(2, self._glove)
                self._word = ui.label("").classes("state-word").props('role="status"')
                self._sentence = ui.label("")
            self._numbers = ui.label("").classes("glove-numbers")
            self._models = ui.element("div").classes("glove-models")
            with ui.element("div").classes("glove-parts"):
                with ui.element("div"):
                    view = HandView(
                        await self._skeleton(glove),
                        label=f"Hand of glove {self._glove}, live",
                        feed=feed,
                        empty="No calibrated pose",
                    ).classes("glove-hand")
                    with ui.row().classes("glove-sides"):
                        for side, name in SIDES:
                            ui.button(name, on_click=partial(view.look, side)).props(
                                "outline no-caps"
                            ).classes("studio-target")
                with ui.element("div").classes("glove-values"):
                    angles = AngleList(feed, label="Angles and their standard deviations")
                    SensorStrips(feed, label=f"Readings of glove {self._glove}, last seconds")
            angles.on_rotation(view.choose)
            view.on_rotation(view.choose)
        await self._offer_models(glove)

    def show(self, state: GloveState) -> None:
        self._word.set_text(state.word + (", simulated" if state.is_simulated else ""))
        if self._word.props.get("data-word") != state.word:
            self._word.props["data-word"] = state.word
            self._word.update()
        self._sentence.set_text(state.sentence)
        rate = "–" if state.rate_hz is None else f"{state.rate_hz:.0f} frames/s"
        age = "" if state.age_ms is None else f", pose {state.age_ms:.0f} ms after the frame"
        self._numbers.set_text(f"{rate}{age}, {state.skipped} frames skipped")

    async def _seen(self) -> Mapping[str, Any]:
        seen = (await self._studio.service.get("/gloves"))["seen"]
        return next((each for each in seen if each["name"] == self._glove), {})

    async def _skeleton(self, glove: Mapping[str, Any]) -> dict[str, Any]:
        """Of the wearer, else of a hand of usual size."""
        hand = glove.get("hand") if glove.get("hand") in ("left", "right") else None
        if glove.get("subject"):
            with suppress(Refusal):
                return await self._studio.service.get(
                    f"/subjects/{quote(glove['subject'])}/skeleton", hand=hand
                )
        return await self._studio.service.get("/skeleton", hand=hand)

    async def _offer_models(self, glove: Mapping[str, Any]) -> None:
        if not glove.get("subject"):
            return
        models = await self._studio.service.get("/models", subject=glove["subject"], layout=glove["layout"])
        if not models:
            return
        names = {each["id"]: version_name(each) for each in models}
        active = next((each["id"] for each in models if each["active"]), None)
        with self._models:
            ui.select(
                names, value=active, label=f"Model of {glove['subject']}", on_change=self._activate
            ).classes("choice")

    async def _activate(self, event: Any) -> None:
        try:
            await self._studio.service.post(f"/models/{event.value}/activate")
        except Refusal as refusal:
            ui.notify(str(refusal), type="warning")
