"""The live test of a glove that was just connected: its readings, and which of them answer a finger."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from nicegui import ui
from nicegui.elements.mixins.text_element import TextElement
from nicegui.events import ValueChangeEventArguments
from starlette.concurrency import run_in_threadpool

from glovecal_client.errors import ClientError
from glovecal_service.studio.finger_test import ANSWERS_FROM, Answered, FingerTest
from glovecal_service.studio.heading import main_act
from glovecal_service.studio.live_feed import GloveFeed
from glovecal_service.studio.repeating import again
from glovecal_service.studio.studio import Studio
from glovecal_service.studio.table import cell, row_head, table

FINGERS = ("index finger", "thumb", "middle finger", "ring finger", "little finger", "wrist")
LOOK_S, LOOKS_SHOWN = 0.1, 4
"""How often readings are looked at; every so many looks they are shown: numbers faster are not read."""
MOVES_FOR = 50
"""Looks after the instruction."""
HEADS = ("Sensor", "Reading, counts", "Moved, counts", "Noise, counts", "Answered to")
NO_GLOVE = "No glove streams yet. Once its capture runs, its readings appear here."
HOLD_STILL = "Hold your hand still."


class LiveTest:
    """Of one glove at a time, the first that streams unless another is chosen."""

    def __init__(self, studio: Studio) -> None:
        self._studio = studio
        self._feed: GloveFeed | None = None
        self._sensors: tuple[str, ...] = ()
        self._cells: dict[str, Sequence[TextElement]] = {}
        self._test: FingerTest | None = None
        self._looks = self._moving = 0
        """Of the page, and since the instruction."""

    def build(self) -> None:
        self._notice = ui.label("").props('role="status"')
        with ui.element("div").classes("capture-fields") as self._form:
            self._glove = ui.select([], label="Glove", on_change=self._choose).classes("choice")
            self._finger = ui.select(list(FINGERS), value=FINGERS[0], label="To be moved").classes("choice")
            self._act = main_act("Test it", self._begin)
        self._instruction = ui.label("").classes("finding-sentence").props('role="status"')
        self._table = ui.element("div")
        ui.context.client.on_delete(self._release)
        again(LOOK_S, self._look)

    async def _look(self) -> None:
        if self._looks % LOOKS_SHOWN == 0:
            await self._look_for_gloves()
        self._looks += 1
        if self._feed is None:
            return
        readings, sensors = self._feed.readings(), tuple(self._feed.sensors)
        if not sensors or len(readings) != len(sensors):
            return
        if sensors != self._sensors:
            self._build_table(sensors)
        self._follow(readings)
        if self._looks % LOOKS_SHOWN == 0:
            self._show(readings)

    async def _look_for_gloves(self) -> None:
        try:
            states = await run_in_threadpool(self._studio.feeds.states)
        except ClientError as error:
            self._notice.set_text(f"The real-time process does not answer: {error}")
            return
        here = [glove for glove, state in states.items() if state.word != "lost"]
        self._notice.set_text("" if here else NO_GLOVE)
        self._form.set_visibility(bool(here))
        if here != self._glove.options:
            chosen = self._glove.value if self._glove.value in here else next(iter(here), None)
            self._glove.set_options(here, value=chosen)

    async def _choose(self, event: ValueChangeEventArguments) -> None:
        self._release()
        self._sensors, self._test = (), None
        self._act.set_visibility(False)  # until its readings are there
        self._table.clear()
        self._instruction.set_text("")
        if event.value is not None:
            self._feed = await run_in_threadpool(self._studio.feeds.open, str(event.value))

    def _release(self) -> None:
        feed, self._feed = self._feed, None
        if feed is not None:
            self._studio.feeds.release(feed)

    def _begin(self) -> None:
        self._test, self._moving = FingerTest(self._sensors), 0
        self._instruction.set_text(HOLD_STILL)

    def _follow(self, readings: np.ndarray) -> None:
        test = self._test
        if test is None or self._moving > MOVES_FOR:
            return
        if self._moving:
            test.move(readings)
            self._moving += 1
            if self._moving > MOVES_FOR:
                self._end(*test.answered())
        elif test.hold(readings):
            self._moving = 1
            self._instruction.set_text(f"Now move your {self._finger.value}, and nothing else.")
        elif test.is_unsteady:
            self._instruction.set_text(f"{HOLD_STILL} It moves.")

    def _end(self, answered: Sequence[Answered], pulled: Sequence[Answered]) -> None:
        if not answered:
            self._instruction.set_text(
                f"No sensor moved by more than {ANSWERS_FROM:g} times its noise. Move more, and test again."
            )
            return
        sentence = f"Your {self._finger.value}: {', '.join(item.text for item in answered)}."
        if pulled:
            sentence += f" Pulled along: {', '.join(item.text for item in pulled)}."
        self._instruction.set_text(sentence)
        for item in answered:
            self._cells[item.sensor][-1].set_text(str(self._finger.value))

    def _build_table(self, sensors: tuple[str, ...]) -> None:
        self._sensors, self._test = sensors, None
        self._act.set_visibility(True)
        self._table.clear()
        with self._table, table("Sensors of the glove, live", HEADS, "live-test"):
            for sensor in sensors:
                with ui.element("tr"):
                    row_head(sensor)
                    self._cells[sensor] = [cell("–") for _ in HEADS[1:]]

    def _show(self, readings: np.ndarray) -> None:
        test = self._test
        for place, sensor in enumerate(self._sensors):
            texts = [f"{readings[place]:.0f}"]
            if test is not None and self._moving:
                texts += [f"{test.moved[place]:.0f}", f"{test.noise[place]:.1f}"]
            for each, text in zip(self._cells[sensor], texts, strict=False):
                if each.text != text:
                    each.set_text(text)
