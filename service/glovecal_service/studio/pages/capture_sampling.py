"""A guided sampling while it goes on: one target at a time, by keys, by timer or by mouse, and its end.

The sampling is one document in the database: a page only shows where it stands and brings the wearer's
wishes, so it goes on after a reload, in another tab, and after a restart of the service.
"""

from __future__ import annotations

from collections import defaultdict
from contextlib import suppress
from functools import partial
from typing import Any
from urllib.parse import quote

from nicegui import ui
from starlette.concurrency import run_in_threadpool

from glovecal_client.errors import ClientError
from glovecal_service.rest.sampling.answer import SamplingView, StepDone, TargetView
from glovecal_service.studio.guide.board import MAIN_KEYS, Board, Motion, Shown, Tone
from glovecal_service.studio.hand.hand_view import SIDES, HandView, side_buttons
from glovecal_service.studio.heading import quiet_act
from glovecal_service.studio.pages.capture_end import SamplingEnd
from glovecal_service.studio.pages.capture_start import show_keys
from glovecal_service.studio.repeating import again
from glovecal_service.studio.service import Refusal
from glovecal_service.studio.studio import Studio

EVERY_S = 0.12
WORD_EVERY_S = 0.5
OVERDUE_S = 4.0
ACTIVE = "active"
KEYS = {
    "main": MAIN_KEYS,
    "redo": ("r", "PageUp"),
    "undo": ("u",),
    "skip": ("s",),
    "pause": ("p",),
}
TONES: dict[str, Tone] = {"recording": "begin", "lost": "lost", "done": "done"}
OUTCOMES = {"good": "good", "bad": "not good", "skipped": "skipped"}

_followers: dict[str, set[str]] = defaultdict(set)
"""Connected pages by the sampling they show."""


class SamplingPage:
    """One open page."""

    def __init__(self, studio: Studio, view: SamplingView) -> None:
        self._studio = studio
        self._view = view
        self._path = f"/sampling/{view.id}"
        self._target = ""
        self._listed: list[Any] = []
        self._ended = False
        self._timers: list[ui.timer] = []

    async def build(self) -> None:
        view = self._view
        self._live = ui.element("div").classes("capture-live")
        if not view.open:
            await self._end()
            return
        with self._live:
            with ui.row().classes("capture-head"):
                ui.label(f"{view.subject}, glove {view.glove}").classes("capture-who")
                self._word = ui.label("").classes("state-word").props('role="status"')
                self._place = ui.label("").classes("capture-place")
            self._bar = ui.linear_progress(0.0, show_value=False, size="10px").props(
                'aria-label="Steps done"'
            )
            self._problem = ui.label("").classes("studio-notice studio-problem").props('role="alert"')
            self._others = ui.label("").classes("studio-notice").props('role="status"')
            with ui.element("div").classes("capture-parts"):
                with ui.element("div").classes("capture-guide"):
                    self._board = Board(self._shown(), keys=KEYS, label="What to do now")
                    self._board.on_act(self._act)
                    self._buttons()
                await self._hand()
            with ui.expansion("Steps so far").classes("capture-steps"):
                self._steps = ui.element("ol").classes("capture-list")
            with ui.expansion("Keys").classes("capture-steps"):
                show_keys()
        self._follow_together()
        self._timers = [again(EVERY_S, self._look), again(WORD_EVERY_S, self._say_state)]
        await self._show()

    def _buttons(self) -> None:
        with ui.element("div").classes("capture-acts"):
            self._main = self._button("Start", "Space", "main", "unelevated no-caps color=indigo-8 size=lg")
            self._button("Redo", "R", "redo")
            self._button("Undo", "U", "undo")
            self._button("Skip", "S", "skip")
            self._pause = self._button("Pause", "P", "pause")
            quiet_act("Stop", self._ask_to_stop)
        with ui.dialog().props('aria-label="Stop the sampling"') as self._stopping, ui.card():
            ui.label("Stop now? Steps that are done become takes; the rest cannot be added later.")
            with ui.row():
                ui.button("Stop", on_click=partial(self._stop)).props(
                    "unelevated no-caps color=red-9"
                ).classes("studio-main-act")
                quiet_act("Go on sampling", self._stopping.close)

    def _button(self, name: str, key: str, act: str, props: str = "outline no-caps") -> ui.button:
        button = ui.button(name, on_click=partial(self._act, act)).props(props)
        button.props(f'aria-keyshortcuts="{key}"').classes(
            "studio-main-act" if act == "main" else "studio-target"
        )
        with button, ui.element("kbd"):
            ui.label(key)
        return button

    async def _hand(self) -> None:
        view = self._view
        skeleton = await self._studio.service.get(f"/subjects/{quote(view.subject)}/skeleton")
        with ui.element("div").classes("capture-hand"):
            self._hand_view = HandView(
                skeleton,
                label="The target hand, and your own hand live",
                feed=f"/studio/feed/{quote(view.glove)}",
                empty="",
                seen_from="corner",
            ).classes("capture-view")
            with ui.element("div").classes("capture-legend"):
                ui.label("Target").classes("legend legend-target")
                self._own = ui.label("Your hand, live").classes("legend legend-live")
            side_buttons(self._hand_view, sides=("corner", *SIDES))

    # What goes on

    async def _look(self) -> None:
        try:
            self._view = await self._studio.service.read(SamplingView, self._path)
        except Refusal as refusal:
            self._problem.set_text(f"The service does not tell how it goes on: {refusal}")
            return
        await self._show()

    async def _show(self) -> None:
        view = self._view
        if not view.open:
            await self._end()
            return
        motion = Motion(view.steadiness_percent, view.still_percent)
        self._board.show(self._shown(), motion if view.phase not in ("done", "stopped", "choosing") else None)
        done = sum(step.outcome in ("good", "skipped") for step in view.steps)
        count = "" if view.protocol == ACTIVE else f" of {len(view.steps)}"
        self._place.set_text(
            f"{done}{count} steps done, {view.capture_s:.0f} s"
            + ("" if view.protocol == ACTIVE else f" of about {view.capture_of_s:.0f} s")
        )
        self._bar.set_visibility(view.protocol != ACTIVE)  # nobody knows how many it will ask
        self._bar.set_value(round(done / len(view.steps), 3))
        self._problem.set_text(self._trouble())
        tabs = len(_followers[view.id])
        self._others.set_text(
            "" if tabs < 2 else f"{tabs} pages show this sampling. Each can drive it; all stay in step."
        )
        self._main.set_enabled(bool(self._main_act()))
        self._main.set_text(
            {"go": "Start", "again": "Repeat", "resume": "Go on"}.get(self._main_act(), "Start")
        )
        self._pause.set_enabled(view.phase not in ("paused", "done", "stopped"))
        self._list_steps()
        await self._show_target()

    def _trouble(self) -> str:
        view = self._view
        overdue = view.phase_of_s is not None and view.phase_s > view.phase_of_s + OVERDUE_S
        if view.problem or not overdue or view.phase == "judged":
            return view.problem
        return "No answer from the recorder. The sampling goes on by itself once it is back; nothing is lost."

    async def _show_target(self) -> None:
        name = self._view.step.name if self._view.step else ""
        if name == self._target:
            return
        self._target = name
        with suppress(Refusal):
            target = await self._studio.service.read(TargetView, f"{self._path}/target")
            self._hand_view.ghost(target.hands)

    def _shown(self) -> Shown:
        view = self._view
        step, phase = view.step, view.phase
        outcome = self._outcome
        bad = phase == "judged" and outcome is not None and outcome.outcome == "bad"
        left = None if view.phase_of_s is None else max(0.0, view.phase_of_s - view.phase_s)
        tone: Tone = ("bad" if bad else "good") if phase == "judged" else TONES.get(phase, "")
        ask, needs = (step.ask, step.needs) if step else ("", "")
        return Shown(
            phase="bad" if bad else "good" if phase == "judged" else phase,
            line=self._line(bad, left),
            ask=ask or {"choosing": "One moment"}.get(phase, ""),
            note=self._note(ask),
            needs=f"You need {needs}." if needs not in ask else "",
            why=" ".join(outcome.reasons) if bad and outcome is not None else "",
            last=self._last_result(step.name if step else ""),
            number=view.say_number,
            tone=tone,
            of_s=view.phase_of_s if phase != "judged" or bad else None,
            left_s=left,
            wants="motion" if step and step.motion == "move" else "still",
        )

    @property
    def _outcome(self) -> StepDone | None:
        """What became of the step at hand."""
        step = self._view.step
        return next((each for each in self._view.steps if step and each.name == step.name), None)

    def _note(self, ask: str) -> str:
        """Which step it is; before it begins also what led here, such as that the signal is back."""
        view = self._view
        if view.step is None:
            return ""
        if view.phase == "waiting" and view.say.endswith(ask):
            return view.say.removesuffix(ask).strip()
        return f"Step {view.step.place}" + ("." if view.protocol == ACTIVE else f" of {len(view.steps)}.")

    def _line(self, bad: bool, left: float | None) -> str:
        view = self._view
        step = view.step
        by_hand = view.trigger == "still" and step and step.motion == "hold" and not step.needs
        if view.phase == "judged":
            again = "Press Space to repeat" if view.trigger == "key" else "It is repeated by itself"
            return f"Not good. {again}." if bad else "Good."
        if view.phase == "waiting":
            if view.trigger == "timer":
                return "Starts by itself."
            return (
                "Take the pose and keep still: it starts by itself." if by_hand else "Press Space when ready."
            )
        if view.phase == "countdown" and left == 0.0:
            return "Waiting for the recording to begin."
        if view.phase == "recording":
            return "Now move." if step and step.motion == "move" else "Hold still."
        return {
            "countdown": "Get ready.",
            "settling": "Keep still.",
            "lost": "Signal lost. Waiting for the glove; then this step is repeated.",
            "paused": "Paused. Press Space to go on.",
            "choosing": "Choosing the next step.",
        }.get(view.phase, "Done. Storing the takes.")

    def _last_result(self, now: str) -> str:
        """Of the step before this one."""
        told = [each for each in self._view.steps if each.outcome and each.name != now]
        if not told or self._view.phase not in ("waiting", "countdown", "choosing", "paused"):
            return ""
        last = told[-1]
        why = f" {' '.join(last.reasons)}" if last.outcome == "bad" else ""
        return f"Before: {last.name}, {OUTCOMES[last.outcome]}.{why}"

    def _list_steps(self) -> None:
        told = [each for each in self._view.steps if each.outcome]
        if told == self._listed:
            return
        self._listed = told
        self._steps.clear()
        with self._steps:
            for each in told:
                with ui.element("li").classes("capture-step"):
                    ui.label(each.name).classes("capture-step-name")
                    ui.label(OUTCOMES[each.outcome]).classes("step-word").props(
                        f'data-outcome="{each.outcome}"'
                    )
                    ui.label(" ".join(each.reasons)).classes("capture-step-why")
                    again = ui.button("Redo", on_click=partial(self._send, "redo", each.name))
                    again.props("flat no-caps").classes("studio-target")
                    again.props["aria-label"] = f"Redo {each.name}"

    # What the wearer wants

    def _main_act(self) -> str:
        """What Space means now: "go", "again", "resume", or "" where it means nothing."""
        phase = self._view.phase
        if phase == "judged":
            return "again" if self._outcome and self._outcome.outcome == "bad" else ""
        return {"waiting": "go", "paused": "resume"}.get(phase, "")

    async def _act(self, act: str) -> None:
        if act == "pause" and self._view.phase == "paused":
            act = "main"
        if act == "main":
            act = {"again": "go"}.get(self._main_act(), self._main_act())
        if act:
            await self._send(act)

    async def _send(self, event: str, step: str | None = None) -> None:
        try:
            body = {} if step is None else {"step": step}
            self._view = await self._studio.service.ask(SamplingView, f"{self._path}/{event}", body)
        except Refusal as refusal:
            # Two presses of a pedal, or of two pages: the first has done it.
            if event not in ("go", "resume"):
                ui.notify(str(refusal), type="warning")
            return
        await self._show()

    def _ask_to_stop(self) -> None:
        self._stopping.open()

    async def _stop(self) -> None:
        self._stopping.close()
        await self._send("stop")

    # Who is there

    async def _say_state(self) -> None:
        try:
            state = (await run_in_threadpool(self._studio.feeds.states)).get(self._view.glove)
        except ClientError as error:
            self._problem.set_text(f"The real-time process does not answer: {error}")
            return
        word = "lost" if state is None else state.word
        self._word.set_text(word + (", simulated" if state is not None and state.is_simulated else ""))
        if self._word.props.get("data-word") != word:
            self._word.props["data-word"] = word
            self._word.update()
            self._own.set_text(
                "Your hand, live" if word not in ("lost", "uncalibrated", "unwatched") else
                "Your hand appears once a model is active" if word == "uncalibrated" else
                "Your hand: no poses arrive"
            )  # fmt: skip

    def _follow_together(self) -> None:
        client, pages = ui.context.client, _followers[self._view.id]
        pages.add(client.id)
        client.on_connect(lambda: pages.add(client.id))
        client.on_disconnect(lambda: pages.discard(client.id))

    async def _end(self) -> None:
        if self._ended:
            return
        self._ended = True
        for timer in self._timers:
            timer.deactivate()
        self._live.clear()
        with self._live:
            await SamplingEnd(self._studio, self._view).build()
