"""Who wears which glove, and what is to be sampled: the forms before a sampling."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Mapping, Sequence
from datetime import datetime
from typing import Any
from urllib.parse import quote

from nicegui import ui
from nicegui.events import ValueChangeEventArguments
from starlette.concurrency import run_in_threadpool

from glovecal_client.errors import ClientError
from glovecal_service.studio.heading import heading
from glovecal_service.studio.service import Refusal
from glovecal_service.studio.studio import Studio

PROTOCOLS = {
    "new_subject": "New subject: poses, widgets, touches (about 5 min)",
    "active": "Active: the model chooses each step (2 to 4 min)",
    "fk_only": "Poses and widgets only",
    "ik_only": "Touches only",
}
TRIGGERS = {
    "key": "By key or foot pedal",
    "timer": "By timer: steps proceed by themselves",
    "still": "By holding the hand still",
}
KEYS_TOLD = (
    ("Space, Enter, Page Down", "start the step, repeat a bad one, go on after a pause"),
    ("R, Page Up", "redo this step, or the last one"),
    ("U", "undo the last result"),
    ("S", "skip the step"),
    ("P", "pause"),
    ("M", "sound on or off"),
)
WORD_EVERY_S = 0.7
LEAST_ROD_MM, MOST_ROD_MM = 5, 200


class WornGlove:
    """The choice of a glove and its wearer, with the glove's state in a word."""

    def __init__(self, studio: Studio, gloves: Sequence[Mapping[str, Any]]) -> None:
        self._studio = studio
        self._gloves = {each["name"]: each for each in gloves}
        self._word: ui.label

    async def build(self, subject: str | None = None) -> None:
        names = [each["name"] for each in await self._studio.service.get("/subjects")]
        states = await _states(self._studio)
        newest = sorted(self._gloves, key=lambda name: (name in states, self._gloves[name]["last_seen_at"]))
        with ui.element("div").classes("capture-fields"):
            self._glove = ui.select(
                list(self._gloves), value=newest[-1], label="Glove", on_change=self._changed
            ).classes("choice")
            wearer = subject or self._gloves[newest[-1]]["subject"]
            self._subject = (
                ui.select(
                    names,
                    value=wearer if wearer in names else None,
                    label="Subject",
                    with_input=True,
                    new_value_mode="add-unique",
                )
                .props('hint="A new name, with Enter, adds a subject."')
                .classes("choice")
            )
        with ui.row().classes("glove-head"):
            self._word = ui.label("").classes("state-word").props('role="status"')
            self._sentence = ui.label("")
        await self._look()
        ui.timer(WORD_EVERY_S, self._look)

    @property
    def glove(self) -> str:
        return str(self._glove.value)

    @property
    def layout(self) -> str | None:
        return self._gloves[self.glove]["layout"]

    @property
    def subject(self) -> str:
        return str(self._subject.value or "").strip().lower()

    async def put_on(self, wearing: str | None = None) -> None:
        """Tell the service who wears the glove, and in which wearing; a new subject is added. Raises
        Refusal."""
        if not self.subject:
            raise Refusal(422, "Choose a subject, or type a new name.")
        known = [each["name"] for each in await self._studio.service.get("/subjects")]
        glove = self._gloves[self.glove]
        if self.subject not in known:
            hand = glove["hand"] if glove["hand"] in ("left", "right") else "right"
            await self._studio.service.post("/subjects", {"name": self.subject, "hand": hand})
        if wearing is not None or glove["subject"] != self.subject:
            body = {"subject": self.subject, "wearing": wearing or glove["wearing"]}
            await self._studio.service.put(f"/gloves/{quote(self.glove)}/wearer", body)

    async def _look(self) -> None:
        state = (await _states(self._studio)).get(self.glove)
        word = "lost" if state is None else "ok" if state.word == "unwatched" else state.word
        self._word.set_text("connected" if word == "ok" else word)
        if self._word.props.get("data-word") != word:
            self._word.props["data-word"] = word
            self._word.update()
        self._sentence.set_text("Its capture is not running." if state is None else state.sentence)

    async def _changed(self, event: ValueChangeEventArguments) -> None:
        wearer = self._gloves[str(event.value)]["subject"]
        if wearer:
            self._subject.set_value(wearer)
        await self._look()


async def _states(studio: Studio) -> dict[str, Any]:
    try:
        return await run_in_threadpool(studio.feeds.states)
    except ClientError:
        return {}


class SamplingForm:
    """The choice of a protocol, and of what starts each step."""

    def __init__(
        self,
        studio: Studio,
        gloves: Sequence[Mapping[str, Any]],
        started: Callable[[dict[str, Any]], Awaitable[None]],
    ) -> None:
        self._studio = studio
        self._worn = WornGlove(studio, gloves)
        self._started = started

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
                self._trigger = ui.select(TRIGGERS, value="key", label="A step starts").classes("choice")
            with ui.element("div").classes("capture-fields"):
                self._widgets = ui.checkbox("I have widgets (wedges of known angle)", value=True)
                self._rod = ui.number(
                    "Rod, mm (empty: none)", value=60, min=LEAST_ROD_MM, max=MOST_ROD_MM
                ).classes("capture-number")
            ui.button("Start sampling", on_click=self._start).props(
                "unelevated no-caps color=indigo-8 size=lg"
            ).classes("studio-main-act")
        show_keys()

    async def _start(self) -> None:
        body: dict[str, Any] = {
            "glove": self._worn.glove, "protocol": self._protocol.value, "trigger": self._trigger.value,
            "rod_mm": [] if self._rod.value is None else [self._rod.value],
        }  # fmt: skip
        try:
            await self._worn.put_on()
            if not self._widgets.value:
                body["widget_deg"] = {rotation: [] for rotation in await self._rotations()}
            view = await self._studio.service.post("/sampling", body | {"subject": self._worn.subject})
        except Refusal as refusal:
            ui.notify(str(refusal), type="warning", timeout=10_000)
            return
        await self._started(view)

    async def _rotations(self) -> list[str]:
        layout = self._worn.layout
        return (await self._studio.service.get(f"/gloves/{quote(layout)}"))["rotations"] if layout else []


class WearingForm:
    """The glove was put on again: its sensors sit elsewhere, and a few poses tell by how much."""

    def __init__(
        self,
        studio: Studio,
        gloves: Sequence[Mapping[str, Any]],
        started: Callable[[dict[str, Any]], Awaitable[None]],
    ) -> None:
        self._studio = studio
        self._worn = WornGlove(studio, gloves)
        self._started = started

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
                self._trigger = ui.select(TRIGGERS, value="key", label="A step starts").classes("choice")
            ui.button("Start the check", on_click=self._start).props(
                "unelevated no-caps color=indigo-8 size=lg"
            ).classes("studio-main-act")
        show_keys()

    async def _start(self) -> None:
        wearing = str(self._wearing.value).strip()
        body = {"protocol": "second_wearing", "trigger": self._trigger.value, "wearing": wearing}
        try:
            await self._require_model()
            await self._worn.put_on(wearing)
            view = await self._studio.service.post(
                "/sampling", body | {"glove": self._worn.glove, "subject": self._worn.subject}
            )
        except Refusal as refusal:
            ui.notify(str(refusal), type="warning", timeout=10_000)
            return
        await self._started(view)

    async def _require_model(self) -> None:
        worn = self._worn
        models = await self._studio.service.get("/models", subject=worn.subject or None, layout=worn.layout)
        if not any(each["active"] for each in models):
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
