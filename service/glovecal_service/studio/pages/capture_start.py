"""What is to be sampled: the forms before a sampling."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Sequence
from datetime import datetime
from typing import Any
from urllib.parse import quote

from nicegui import ui

from glovecal_service.rest.glove.answer import GloveView, LayoutView
from glovecal_service.rest.model.answer import Model
from glovecal_service.rest.sampling.answer import SamplingView
from glovecal_service.studio.heading import heading, main_act
from glovecal_service.studio.pages.glove_and_wearer import GloveAndWearer
from glovecal_service.studio.service import Refusal, refusals, warn_long
from glovecal_service.studio.studio import Studio

PROTOCOLS = {
    "new_subject": "New subject: poses, widgets, touches (about 5 min)",
    "active": "Active: the model chooses each step (2 to 4 min)",
    "fk_only": "Poses and widgets only",
    "ik_only": "Touches only",
    "five_shapes": "Five hand shapes (two minutes)",
}
TRIGGERS = {
    "key": "By key or foot pedal",
    "timer": "By timer: steps proceed by themselves",
    "still": "By holding the hand still; motions and widgets by timer",
}
KEYS_TOLD = (
    ("Space, Enter, Page Down", "start the step, repeat a bad one, go on after a pause"),
    ("R, Page Up", "redo this step, or the last one"),
    ("U", "undo the last result"),
    ("S", "skip the step"),
    ("P", "pause"),
    ("M", "sound on or off"),
)
LEAST_ROD_MM, MOST_ROD_MM = 5, 200


class _Form:
    """What is asked before a sampling begins. ``started``: told of the sampling."""

    def __init__(
        self,
        studio: Studio,
        gloves: Sequence[GloveView],
        started: Callable[[SamplingView], Awaitable[None]],
    ) -> None:
        self._studio = studio
        self._worn = GloveAndWearer(studio, gloves)
        self._started = started

    def _ask_trigger(self) -> None:
        self._trigger = ui.select(TRIGGERS, value="key", label="A step starts").classes("choice")

    def _offer(self, text: str, start: Callable[[], Awaitable[None]]) -> None:
        """The button that starts it, and the keys that work from then on. ``start`` raises Refusal."""

        async def clicked() -> None:
            with refusals(warn_long):
                await start()

        main_act(text, clicked, large=True)

    async def _begin(self, body: dict[str, Any]) -> None:
        """Raises Refusal."""
        worn = {"glove": self._worn.glove, "subject": self._worn.subject}
        await self._started(await self._studio.service.ask(SamplingView, "/sampling", body | worn))


class SamplingForm(_Form):
    """The choice of a protocol, and of what starts each step."""

    async def build(self) -> None:
        with ui.element("section").classes("card capture-form").props('aria-label="New sampling"'):
            heading(2, "Sample with the glove's own protocol")
            ui.label(
                "Poses, wedges and touches whose angles are known; no reference system is needed. "
                "Each step is judged at once."
            )
            await self._worn.build()
            with ui.element("div").classes("capture-fields"):
                self._protocol = ui.select(PROTOCOLS, value="new_subject", label="Protocol").classes("choice")
                self._ask_trigger()
            with ui.element("div").classes("capture-fields"):
                self._widgets = ui.checkbox("I have widgets (wedges of known angle)", value=True)
                self._rod = ui.number(
                    "Rod, mm (empty: none)", value=60, min=LEAST_ROD_MM, max=MOST_ROD_MM
                ).classes("capture-number")
            self._offer("Start sampling", self._start)
        show_keys()

    async def _start(self) -> None:
        body: dict[str, Any] = {
            "protocol": self._protocol.value, "trigger": self._trigger.value,
            "rod_mm": [] if self._rod.value is None else [self._rod.value],
        }  # fmt: skip
        await self._worn.put_on()
        if not self._widgets.value:
            body["widget_deg"] = {rotation: [] for rotation in await self._rotations()}
        await self._begin(body)

    async def _rotations(self) -> list[str]:
        layout = self._worn.layout
        if not layout:
            return []
        return (await self._studio.service.read(LayoutView, f"/gloves/{quote(layout)}")).rotations


class WearingForm(_Form):
    """The glove was put on again: its sensors sit elsewhere, and a few poses tell by how much."""

    async def build(self) -> None:
        with ui.element("section").classes("card capture-form").props('aria-label="Check of a new wearing"'):
            heading(2, "Check a new wearing")
            ui.label(
                "Put on again, a glove sits a little elsewhere. Four held poses tell the active model by how "
                "much: about 25 s by key, 40 s by timer."
            )
            await self._worn.build()
            with ui.element("div").classes("capture-fields"):
                self._wearing = ui.input(
                    "Name of this wearing", value=f"{datetime.now():%Y-%m-%d %H.%M}"
                ).classes("choice")
                self._ask_trigger()
            self._offer("Start the check", self._start)
        show_keys()

    async def _start(self) -> None:
        wearing = str(self._wearing.value).strip()
        body = {"protocol": "second_wearing", "trigger": self._trigger.value, "wearing": wearing}
        await self._require_model()
        await self._worn.put_on(wearing)
        await self._begin(body)

    async def _require_model(self) -> None:
        worn = self._worn
        query = {"subject": worn.subject or None, "layout": worn.layout, "hand": worn.hand}
        models = await self._studio.service.every(Model, "/models", **query)
        if not any(each.active for each in models):
            raise Refusal(409, f"No model is active for {worn.subject or 'nobody'}: sample and train first.")


def show_keys() -> None:
    """What the keys do; a foot pedal sends one of them."""
    with ui.element("section").classes("capture-keys").props('aria-label="Keys"'):
        heading(2, "Hands in gloves: keys and foot pedals")
        with ui.element("dl"):
            for keys, what in KEYS_TOLD:
                with ui.element("div"):
                    with ui.element("dt"):
                        for key in keys.split(", "):
                            with ui.element("kbd"):
                                ui.label(key)
                    with ui.element("dd"):
                        ui.label(what)
        ui.label("A foot pedal is a keyboard: set it to Space, Enter or Page Down.")
