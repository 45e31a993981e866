"""One glove on the Live page."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from contextlib import suppress
from functools import partial
from typing import Any
from urllib.parse import quote

from nicegui import ui
from nicegui.elements.mixins.text_element import TextElement

from glovecal_service.rest.glove.answer import GloveView
from glovecal_service.rest.model.answer import Model
from glovecal_service.studio.amounts import version_name
from glovecal_service.studio.glove_state import GloveState
from glovecal_service.studio.hand.hand_view import SIDES, HandView
from glovecal_service.studio.hand.raw_hand import RawHand
from glovecal_service.studio.heading import heading
from glovecal_service.studio.pages.explained_joint import ExplainedJoint
from glovecal_service.studio.pages.refine_by_hand import RefineByHand
from glovecal_service.studio.service import Refusal
from glovecal_service.studio.strips.live_values import AngleList, SensorStrips
from glovecal_service.studio.studio import Studio
from glovecal_service.studio.table import fact_list

RAW_IS = (
    "Raw (violet) is no calibration: each sensor alone, drawn linearly from its least to its greatest "
    "reading since this page was opened, over the joint's usual range. Open and close the hand once; what "
    "has not moved rests. The wrist is that of the calibrated hand."
)
FACTS = {
    "Rate": "Frames a second, measured by the capture daemon",
    "Age": "From the service's receipt of a frame to its pose",
    "Skipped": "Frames of this run that the service left out for newer ones",
    "Lost": "Frames that were sent and never reached the service since it started",
    "Refused": "Frames that reached the service and could not be used",
}


class GloveCard:
    """State, hand, angles and readings; another model of the wearer is served from the next frame on."""

    def __init__(self, studio: Studio, glove: str, look_again: Callable[[], Awaitable[None]]) -> None:
        """``look_again``: what is to be done after the models were changed here."""
        self._studio = studio
        self._glove = glove
        self._look_again = look_again
        self._worn: tuple[Any, ...] = ()
        self._models: dict[str, str] = {}
        self._active: str | None = None
        self._joint: ExplainedJoint | None = None

    @property
    def place(self) -> tuple[str, int, str]:
        """Sorts gloves: those of a wearer together, the left hand first, as one sees one's own."""
        subject, _, hand, _ = self._worn
        return subject or "\U0010ffff", {"left": 0, "right": 1}.get(hand, 2), self._glove

    async def build(self, glove: GloveView | None) -> None:
        """``glove``: as the service knows it, None before anything was said of it."""
        self.section = ui.element("section").classes("glove")
        self.section.props["aria-label"] = f"Glove {self._glove}"
        await self._fill(glove)

    def move_to(self, place: int) -> None:
        """Among the cards of the page."""
        self.section.move(target_index=place)

    async def follow(self, glove: GloveView | None) -> None:
        """Show what was changed elsewhere: the wearer, the models and which one is active."""
        if _worn(glove) == self._worn:
            await self._offer_models(glove)
        else:
            await self._fill(glove)

    def look(self, state: GloveState) -> None:
        """Show the state of this moment."""
        self._word.set_text(state.word + (", simulated" if state.is_simulated else ""))
        if self._word.props.get("data-word") != state.word:
            for element in (self._word, self.section):
                element.props["data-word"] = state.word
                element.update()
        self._sentence.set_text(state.sentence)
        facts = {
            "Rate": "–" if state.rate_hz is None else f"{state.rate_hz:.0f} frames/s",
            "Age": "–" if state.age_ms is None else f"{state.age_ms:.1f} ms",
            "Skipped": f"{state.skipped}",
            "Lost": "–" if state.lost is None else f"{state.lost}",
            "Refused": f"{state.refused}",
        }
        for name, text in facts.items():
            self._facts[name].set_text(text)

    async def _fill(self, glove: GloveView | None) -> None:
        feed = f"/studio/feed/{quote(self._glove)}"
        skeleton = await self._skeleton(glove)
        raw = await RawHand.of(self._studio.service, glove and glove.layout)
        self._worn, self._models, self._active = _worn(glove), {}, None
        self._is_offered = False
        if self._joint is not None:
            self._joint.end()
        self.section.clear()
        with self.section:
            with ui.row().classes("glove-head"):
                heading(2, self._glove)
                self._word = ui.label("").classes("state-word").props('role="status"')
                subject, _, hand, _ = self._worn
                ui.label(", ".join(filter(None, (subject, f"{hand} hand" if hand else ""))))
            self._sentence = ui.label("").classes("glove-sentence")
            self._facts = fact_list(FACTS)
            self._choice = ui.element("div").classes("glove-models")
            with ui.element("div").classes("glove-parts"):
                with ui.element("div").classes("glove-seen"):
                    view = HandView(
                        skeleton, label=f"Hand of glove {self._glove}, live", feed=feed,
                        empty="No calibrated pose",
                    ).classes("glove-hand")  # fmt: skip
                    self._view_acts(view, raw)
                    self._joint = ExplainedJoint(self._studio, self._glove, view)
                    self._refine = RefineByHand(self._studio, self._look_again)
                with ui.element("div").classes("glove-values"):
                    self._joint.choose_in(AngleList(feed, label="Angles and their standard deviations"))
                    heading(3, "Readings, last 6 s")
                    SensorStrips(feed, label=f"Readings of glove {self._glove}, last seconds")
        await self._offer_models(glove)

    def _view_acts(self, view: HandView, raw: RawHand) -> None:
        with ui.row().classes("glove-acts"):
            with ui.element("div").classes("glove-sides").props('role="group" aria-label="Seen from"'):
                for side in SIDES:
                    _act(side.capitalize(), partial(view.look, side))
            with ui.element("div").classes("glove-sides").props('role="group" aria-label="Hands shown"'):
                _switch("Calibrated", True, view.calibrated)
                self._turn_raw = _switch("Raw", False, lambda shown: self._show_raw(view, raw, shown))
        self._raw_is = ui.label(RAW_IS).classes("glove-raw-is")
        self._raw_is.set_visibility(False)
        raw.show(view, False)
        with ui.element("div").classes("sd-scale").props('role="note"'):
            ui.label("Colour and size of a joint: standard deviation of its angle, 0°")
            ui.element("span").classes("sd-scale-bar")
            ui.label("8° and more")

    def _show_raw(self, view: HandView, raw: RawHand, shown: bool) -> None:
        raw.show(view, shown)
        self._raw_is.set_visibility(shown)

    async def _skeleton(self, glove: GloveView | None) -> dict[str, Any]:
        """Of the wearer, else of a hand of usual size."""
        hand = glove and glove.known_hand
        if glove and glove.subject:
            with suppress(Refusal):
                return await self._studio.service.get(f"/subjects/{quote(glove.subject)}/skeleton", hand=hand)
        return await self._studio.service.get("/skeleton", hand=hand)

    async def _offer_models(self, glove: GloveView | None) -> None:
        """The models of the wearer; what is active elsewhere is chosen here."""
        if glove is None or not glove.layout:
            return
        query = {"subject": glove.subject, "layout": glove.layout, "hand": glove.known_hand}
        found = await self._studio.service.every(Model, "/models", **query) if glove.subject else []
        if not found:
            self._offer_calibration(glove.subject)
            return
        names = {each.id: version_name(each) for each in found}
        active = next((each.id for each in found if each.active), None)
        if names == self._models and active == self._active:
            return
        is_first = not self._models
        self._models, self._active = names, active
        if is_first:
            self._choice.clear()
            with self._choice:
                self._select = ui.select(
                    names, value=active, label=f"Model of {glove.subject}", on_change=self._activate
                ).classes("choice")
        else:
            self._select.set_options(names, value=active)
        await self._refine.follow(active)

    def _offer_calibration(self, subject: str | None) -> None:
        """The raw hand moves at once; what is shown calibrated comes after this."""
        if self._is_offered:
            return
        self._is_offered = True
        self._turn_raw()
        with self._choice:
            who = f"?who={quote(subject)}" if subject else ""
            ui.link("Calibrate this hand", f"/capture{who}").classes("studio-link next-step-act")

    async def _activate(self, event: Any) -> None:
        if event.value in (None, self._active):  # this page follows a change made elsewhere
            return
        try:
            await self._studio.service.post(f"/models/{event.value}/activate")
        except Refusal as refusal:
            ui.notify(str(refusal), type="warning")
            self._select.set_value(self._active)
            return
        self._active = event.value


def _worn(glove: GloveView | None) -> tuple[Any, ...]:
    """What a card is built for: subject, layout, hand, sensors."""
    if glove is None:
        return None, None, None, ""
    return glove.subject, glove.layout, glove.known_hand, str(glove.meta.get("sensors"))


def _act(name: str, act: Callable[[], Any]) -> TextElement:
    """A plain button: the library's has one look, pressed or not."""
    button = TextElement(tag="button", text=name).classes("glove-act").props('type="button"')
    button.on("click", act)
    return button


def _switch(name: str, shown: bool, show: Callable[[bool], Any]) -> Callable[[], None]:
    """A button that stays pressed; what presses it."""

    def turn() -> None:
        now = button.props["aria-pressed"] != "true"
        button.props["aria-pressed"] = "true" if now else "false"
        button.update()
        show(now)

    button = _act(name, turn)
    button.props["aria-pressed"] = "true" if shown else "false"
    return turn
