"""Free recording with its pre-roll, by key or mouse."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC, datetime
from functools import partial
from typing import Any

from nicegui import ui

from glovecal_models.diagnosis.answer import TakePlan
from glovecal_service.rest.glove.answer import Film, GloveView, Recording
from glovecal_service.rest.take.answer import Take
from glovecal_service.studio.guide.board import MAIN_KEYS, Board, Shown, Tone
from glovecal_service.studio.heading import heading, main_act
from glovecal_service.studio.pages.glove_and_wearer import GloveAndWearer
from glovecal_service.studio.pages.take_reference import TakeReference
from glovecal_service.studio.pages.take_view import TakeView
from glovecal_service.studio.repeating import again
from glovecal_service.studio.service import Refusal, refusals, warn_long
from glovecal_service.studio.studio import Studio

EVERY_S = 0.2
PRE_ROLL_S = 60
LONGEST_PRE_ROLL_S = 600
LONGEST_S = 3600
FREE = "free-"
OF_A_SAMPLING = "sampling-"
"""Recordings of this name belong to a guided sampling."""
READY = "Ready to record"
FILMED = {
    "": "No video",
    "camera:0": "Camera 0",
    "camera:1": "Camera 1",
    "rendered": "Drawn pictures, to try",
}
WAITING = Shown("waiting", "Press Space to start.", ask=READY)
OPEN = ("requested", "recording", "stopping")


class RecordingPage:
    """One open page. A recording that goes on is taken up again after a reload."""

    def __init__(self, studio: Studio, gloves: Sequence[GloveView]) -> None:
        self._studio = studio
        self._worn = GloveAndWearer(studio, gloves)
        self._recording: Recording | None = None
        self._proposal, self._next = "", 0
        """The job of a diagnosis that wants takes, and the place of the next of them."""
        self._plan: TakePlan | None = None
        self._counted = ""
        """The recording that was counted last as one of them."""
        self._films = False
        """A video goes on that was begun here."""
        self._filmed = ""
        self._looked_at: tuple[str, ui.element | None] = "", None

    async def build(self, proposal: str, plan: TakePlan | None, subject: str | None, place: int) -> None:
        """``plan``: of the job ``proposal``, about ``subject``; its takes from ``place`` on, which counts
        from 1, are still to be recorded."""
        self._proposal, self._plan = proposal, plan
        self._next = max(place - 1, 0)
        with ui.element("section").classes("card capture-form").props('aria-label="Recording"'):
            self._proposed = ui.element("div").classes("capture-proposal")
            await self._worn.build(subject)
            with ui.element("div").classes("capture-fields"):
                self._wearing = ui.input("Name of the new wearing").classes("choice")
                self._name = ui.input("Name of the take").classes("choice")
                self._seconds = ui.number(
                    "Stop after, s (empty: by key)", value=None, min=1, max=LONGEST_S
                ).classes("capture-number")
                self._pre_roll = ui.number(
                    "Pre-roll, s", value=PRE_ROLL_S, min=0, max=LONGEST_PRE_ROLL_S
                ).classes("capture-number")
            self._film = ui.select(FILMED, value="", label="Film it, with a camera of the service's computer")
            self._film.classes("choice")
        self._fill_in()
        self._board = Board(WAITING, keys={"main": MAIN_KEYS}, label="What happens now")
        self._board.on_act(self._act)
        with ui.element("div").classes("capture-acts"):
            self._main = main_act("Start recording", partial(self._act, "main"), large=True)
        self._account = ui.element("div").classes("findings").props('aria-live="polite"')
        self._reference = TakeReference(self._studio, self._look_at)
        await self._reference.build()
        self._recording = await self._going_on()
        self._timer = again(EVERY_S, self._look)
        self._show()

    @property
    def _planned(self):
        """The next take of the plan; None where there is none, or all were recorded."""
        return None if self._plan is None else self._plan.take_at(self._next)

    @property
    def _ask(self) -> str:
        """What the wearer is to do; empty: nothing in particular."""
        planned = self._planned
        return "" if planned is None else planned.step.what

    def _fill_in(self) -> None:
        """The form for the next take of the plan, else for one in free motion."""
        planned = self._planned
        self._proposed.clear()
        with self._proposed:
            if self._plan is None or planned is None:
                heading(2, "Record a take" if self._plan is None else "All takes of the plan are recorded")
                if self._plan is not None:
                    ui.label("Give them references, train with them, and diagnose again.")
            else:
                heading(2, f"Take {self._next + 1} of {len(self._plan.each_take)} that the diagnosis wants")
                if planned.is_put_on_anew:
                    ui.label("Take the glove off and put it on again.")
                ui.label(planned.step.what)
                ui.label(self._plan.columns_sentence)
                if planned.step.separates:
                    ui.label(f"It decides between {', '.join(planned.step.separates)}.")
        is_anew = planned is not None and planned.is_put_on_anew
        self._wearing.set_visibility(is_anew)
        self._wearing.set_value(f"{datetime.now():%Y-%m-%d %H.%M}" if is_anew else "")
        self._name.set_value(_free_name() if planned is None else planned.name)
        self._seconds.set_value(None if planned is None else planned.step.seconds)

    def _go_on(self) -> None:
        """To the next take of the plan, also where the page is loaded again."""
        if self._planned is not None:
            self._next += 1
            ui.navigate.history.replace(f"?proposal={self._proposal}&place={self._next + 1}")
            self._fill_in()
            self._show()

    async def _going_on(self) -> Recording | None:
        found = await self._studio.service.read(list[Recording], "/recordings", only_open=True)
        return next((each for each in found if not each.name.startswith(OF_A_SAMPLING)), None)

    async def _act(self, act: str) -> None:
        with refusals(warn_long):
            if self._recording is None or self._recording.state not in OPEN:
                await self._start()
            elif self._recording.state != "stopping":
                stopped = f"/recordings/{self._recording.id}/stop"
                self._recording = await self._studio.service.ask(Recording, stopped)
        self._show()

    async def _start(self) -> None:
        await self._worn.put_on(str(self._wearing.value).strip() or None)
        self._account.clear()
        if self._film.value:
            await self._studio.service.post("/films", {"source": self._film.value})
            self._films = True
        body: dict[str, Any] = {
            "glove": self._worn.glove,
            "name": str(self._name.value).strip(),
            "subject": self._worn.subject,
        }
        try:
            body |= {"lead_s": self._pre_roll.value or 0}
            self._recording = await self._studio.service.ask(Recording, "/recordings", body)
        except Refusal:
            if self._films:
                self._films = False
                await self._studio.service.post("/films/stop")
            raise

    async def _look(self) -> None:
        """Nothing is asked while nothing is recorded."""
        before = self._recording
        if before is None or before.state not in (*OPEN, "repairing"):
            return
        with refusals():
            now = await self._studio.service.read(Recording, f"/recordings/{before.id}")
            self._filmed = await self._film_line()
            limit = self._seconds.value
            if now.state == "recording" and limit and _seconds(now) >= limit:
                now = await self._studio.service.ask(Recording, f"/recordings/{now.id}/stop")
            self._recording = now
            self._show()
            if (now.state, now.facts) != (before.state, before.facts):
                await self._tell(now)

    def _show(self) -> None:
        recording = self._recording
        state = recording.state if recording else ""
        self._main.set_text("Stop" if state in ("requested", "recording") else "Start recording")
        self._main.set_enabled(state != "stopping")
        if recording is None or state not in OPEN:
            tone: Tone = "done" if recording else ""
            shown = Shown(
                "waiting",
                "Press Space to start.",
                ask=self._ask or READY,
                number=2 if recording else 0,
                tone=tone,
            )
            self._board.show(shown)
            return
        seconds, limit = _seconds(recording), self._seconds.value
        frames = recording.account.recorded
        line = {"requested": "Beginning.", "stopping": "Ending."}.get(
            state, "Recording. Press Space to stop."
        )
        is_on = state == "recording"
        shown = Shown(
            phase=state, line=line, ask=self._ask or f"{seconds:.0f} s",
            note="" if frames is None else f"{frames} frames{self._filmed}", number=1 if is_on else 0,
            tone="begin" if is_on else "", of_s=limit or None,
            left_s=max(0.0, limit - seconds) if limit else None,
        )  # fmt: skip
        self._board.show(shown)

    async def _tell(self, recording: Recording) -> None:
        """What became of the frames, once the recording is over."""
        account = recording.account
        if recording.state in OPEN:
            return
        self._account.clear()
        if str(self._name.value).startswith(FREE):
            self._name.set_value(_free_name())
        if account.take and self._counted != recording.id:
            self._counted = recording.id
            self._go_on()
        with self._account, ui.element("section").classes("finding"):
            heading(2, f"{recording.name}: {recording.state}")
            if account.recorded is not None:
                ui.label(f"Pre-roll: {account.pre_roll.seconds:.0f} s before the start.")
            if account.sentence:
                ui.label(account.sentence)
            if self._films:
                await self._tell_video(account.take)
            if account.take:
                ui.label(f"Take {account.take}.").classes("version-id")
                self._looked_at = account.take, ui.element("div")
                await self._look_at(account.take)
                await self._reference.choose(account.take)

    async def _look_at(self, take: str) -> None:
        """What was recorded last, if that take is it."""
        last, place = self._looked_at
        if place is not None and take == last:
            own = await self._studio.service.read(Take, f"/takes/{take}")
            place.clear()
            with place:
                await TakeView(self._studio, own).build()

    async def _film_line(self) -> str:
        if not self._films:
            return ""
        film = await self._studio.service.read(Film, "/films")
        return f", {film.pictures} pictures" + ("" if film.is_on else "; the camera is lost")

    async def _tell_video(self, take: str | None) -> None:
        """End it, and show it beside the take."""
        self._films = False
        try:
            body = {"takes": [take] if take else []}
            film = await self._studio.service.ask(Film, "/films/stop", body)
        except Refusal as refusal:
            ui.label(str(refusal)).classes("studio-notice")
            return
        ui.label(f"Video {film.file}: {film.pictures} pictures, in the service's folder films.")
        for sentence in (film.problem, *film.sentences):
            if sentence:
                ui.label(sentence)


def _free_name() -> str:
    return f"{FREE}{datetime.now():%H%M%S}"


def _seconds(recording: Recording) -> float:
    """Since it was asked for."""
    return max(0.0, (datetime.now(UTC) - recording.requested_at).total_seconds())
