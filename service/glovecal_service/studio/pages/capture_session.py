"""A session with one or two gloves: are they warm, what do their cards hold, how far have they drifted."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence
from functools import partial
from typing import Any

from nicegui import ui

from glovecal_service.rest.glove.answer import Card, GloveAnswers, Gloves, LiveGlove, Recording
from glovecal_service.rest.take.answer import SessionDriftView
from glovecal_service.studio.heading import heading
from glovecal_service.studio.repeating import again
from glovecal_service.studio.service import Refusal
from glovecal_service.studio.studio import Studio
from glovecal_service.studio.table import table, text_row

EVERY_S = 2.0
PAUSE_S, HELD_S = 4.0, 4.0
"""For each shape: to get into it, and to hold it."""
WARM_UP_MIN = 20
MOST_GLOVES = 8
COLUMNS = ("Glove", "Battery", "Clock ahead", "Std. dev.", "File", "Files on the card", "Free")


class SessionPage:
    """One open page. Gloves are asked for their cards by button alone: their streams pause meanwhile."""

    def __init__(self, studio: Studio) -> None:
        self._studio = studio
        self._gloves: list[str] = []
        """Those that stream now."""
        self._is_busy = False

    async def build(self) -> None:
        self._shapes = await self._studio.service.get("/takes/session-drift")
        with ui.element("section").classes("card capture-form").props('aria-label="Warm-up"'):
            heading(2, f"Warm-up: {WARM_UP_MIN} minutes")
            self._warm = ui.element("div").props('role="status"')
        with ui.element("section").classes("card capture-form").props('aria-label="Memory cards"'):
            heading(2, "Recording on the gloves' memory cards")
            ui.label("For gloves with a card (CyberGlove III). A stream pauses for a second at each button.")
            with ui.row().classes("glove-acts"):
                for name, do in (("Show", "status"), ("Set clocks", "set-clock"), ("Stop", "stop")):
                    _act(name, partial(self._command, do))
            with ui.element("div").classes("capture-fields"):
                self._file = ui.input("File, up to 8 letters and a suffix", value="TAKE1.DAT").classes(
                    "choice"
                )
                _act("Start on all", partial(self._command, "start"))
            self._cards = ui.element("div").props('aria-live="polite"')
        with ui.element("section").classes("card capture-form").props('aria-label="Calibration sequence"'):
            heading(2, "Five hand shapes, at the start and at the end")
            ui.label("All gloves at once. At the end the drift since the start is told.")
            with ui.row().classes("glove-acts"):
                _act("Record at the start", partial(self._sequence, "start"))
                _act("Record at the end", partial(self._sequence, "end"))
            self._ask = ui.label("").classes("capture-ask").props('role="status"')
            self._drift = ui.element("div").props('aria-live="polite"')
        self._timer = again(EVERY_S, self._look)
        await self._look()

    async def _look(self) -> None:
        """The warm-up of each glove."""
        try:
            live = await self._studio.service.read(list[LiveGlove], "/live-gloves")
        except Refusal as refusal:
            live, said = [], str(refusal)
        else:
            said = "No glove streams."
        self._gloves = [each.glove for each in live if each.on_for_s is not None][:MOST_GLOVES]
        self._warm.clear()
        with self._warm:
            if not live:
                ui.label(said)
            for each in live:
                ui.label(_warm_line(each))
                for warning in each.warnings:
                    ui.label(f"{each.glove}: {warning.sentence} {warning.advice}").classes("studio-notice")

    async def _command(self, do: str) -> None:
        if self._is_busy or not self._gloves:
            return
        self._is_busy = True
        argument = str(self._file.value).strip() if do == "start" else ""
        try:
            body = {"gloves": self._gloves, "do": do, "argument": argument}
            found = await self._studio.service.ask(GloveAnswers, "/glove-commands", body)
        except Refusal as refusal:
            ui.notify(str(refusal), type="warning", timeout=10_000)
            return
        finally:
            self._is_busy = False
        self._cards.clear()
        with self._cards:
            known = [each for each in found.answers if each.answer]
            if known:
                with table("What the gloves answered", COLUMNS):
                    for each in known:
                        text_row(*_row(each.glove, each.card))
            for each in found.answers:
                if each.problem:
                    ui.label(f"{each.glove}: {each.problem}").classes("studio-notice")
            for sentence in found.sentences:
                ui.label(sentence)

    async def _sequence(self, place: str) -> None:
        """Each shape in turn, a take of each glove."""
        if self._is_busy or not self._gloves:
            return
        self._is_busy = True
        worn: list[tuple[str, str]] = []
        try:
            for shape, ask in self._shapes.items():
                self._ask.set_text(f"{ask} Recording begins in {PAUSE_S:.0f} s.")
                await asyncio.sleep(PAUSE_S)
                started = []
                for glove in self._gloves:
                    body = {"glove": glove, "name": f"{place}-{shape}", "lead_s": 0}
                    started.append(await self._studio.service.ask(Recording, "/recordings", body))
                self._ask.set_text(f"{ask} Hold it, {HELD_S:.0f} s.")
                await asyncio.sleep(HELD_S)
                for each in started:
                    stopped = await self._studio.service.ask(Recording, f"/recordings/{each.id}/stop")
                    worn += [(stopped.subject, stopped.glove)] if stopped.subject else []
            self._ask.set_text(f"The {len(self._shapes)} shapes are recorded.")
        except Refusal as refusal:
            self._ask.set_text(f"Stopped: {refusal}")
            return
        finally:
            self._is_busy = False
        if place == "end":
            await asyncio.sleep(EVERY_S)  # the last takes are being written
            await self._tell_drift(list(dict.fromkeys(worn)))

    async def _tell_drift(self, worn: Sequence[tuple[str, str]]) -> None:
        """``worn``: each subject with a glove."""
        self._drift.clear()
        seen = {each.name: each for each in (await self._studio.service.read(Gloves, "/gloves")).seen}
        for subject, glove in worn:
            hand = seen[glove].known_hand
            try:
                body = {"subject": subject, "hand": hand}
                found = await self._studio.service.ask(SessionDriftView, "/takes/session-drift", body)
                said = found.sentence
            except Refusal as refusal:
                said = str(refusal)
            with self._drift:
                ui.label(f"{subject}, {hand} hand: {said}" if hand else f"{subject}: {said}")


def _act(name: str, do: Any) -> None:
    ui.button(name, on_click=do).props("outline no-caps color=indigo-8")


def _warm_line(each: LiveGlove) -> str:
    on_for, left = each.on_for_s, each.warm_up_left_s
    if on_for is None:
        return f"{each.glove}: its capture does not answer."
    if not left:
        return f"{each.glove}: warm, captured for {on_for / 60:.0f} minutes."
    return f"{each.glove}: not warm yet, {left / 60:.0f} of {WARM_UP_MIN} minutes left; readings will drift."


def _row(glove: str, card: Card) -> tuple[str, ...]:
    clock = card.clock
    return (
        glove,
        "–" if card.battery_v is None else f"{card.battery_v:.2f} V",
        f"{1e3 * clock.ahead_s:+.1f} ms" if clock else "–",
        f"{1e3 * clock.sd_s:.1f} ms" if clock else "–",
        card.active_file or "–",
        ", ".join(card.files or ()) or "–",
        "–" if card.free_mb is None else f"{card.free_mb} MB",
    )
