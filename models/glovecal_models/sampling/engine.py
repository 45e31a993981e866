"""The protocol as a state machine, driven by (time, frame, event) and nothing else.

    waiting -> countdown -> settling (poses only) -> recording -> judged -> waiting ... -> done
    choosing: a protocol that grows has no step left; ``choose`` is asked for more until it knows.
    lost: no frame came; goes on by itself when the glove is back.   paused, stopped: the user's wish.

It has no clock, no thread and no file: whoever drives it gives the time, and keeps ``state`` after a change.

How a sampling goes from one phase into another, and what the user may want in the middle of it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal, get_args

from glovecal_models.errors import BadInput
from glovecal_models.names import did_you_mean
from glovecal_models.sampling import speech
from glovecal_models.sampling.limits import SAMPLING_LIMITS, SamplingLimits
from glovecal_models.sampling.protocol import COUNTDOWN_S, SETTLE_S, WIDEST_DEG, Protocol, Step
from glovecal_models.sampling.sampled_takes import repeatability
from glovecal_models.sampling.state import (
    OVER,
    RUNNING,
    ActiveRanges,
    Attempt,
    Choose,
    GloveReading,
    Phase,
    RecentReadings,
    SamplingState,
    Trigger,
)
from glovecal_models.sampling.verdict import TouchCheck, moved_since_start, verdict

TIMER_S = 3.0
GESTURE_STILL_S = 1.0
SHOWN_S = 0.6
"""A good verdict is shown for so long."""


class Transitions:
    """What happens to one ``state``. Times are seconds of one clock that does not go back."""

    def __init__(self, state: SamplingState, limits: SamplingLimits = SAMPLING_LIMITS) -> None:
        self.state, self.limits = state, limits
        self.recording: str | None = ""
        """Name of the recording that the frames are written to; marked in each attempt. None: nobody writes
        them now, and no step is recorded until somebody does."""
        self._ranges = ActiveRanges.from_document(state.ranges)
        self._recent = RecentReadings()
        self._heard_s: float | None = None
        """When the last frame came."""

    def _judged(self, now_s: float, attempt: Attempt) -> None:
        self.state.attempts.append(attempt)
        said = speech.again(attempt.reasons) if attempt.outcome == "bad" else speech.GOOD
        self._enter("judged", now_s, said)

    def _accept_verdict(self, now_s: float) -> None:
        """A good verdict stands, whatever comes before it was shown long enough."""
        if self.state.phase == "judged" and self.state.attempts[-1].counts:
            self._next(now_s)

    def _next(self, now_s: float, said: str = "") -> None:
        self.state.step = self.state.first_unfinished()
        if self.state.step or self.state.protocol.grows:
            self._ask(now_s, said)
        else:
            self._end("done", now_s, speech.DONE)

    def _ask(self, now_s: float, said: str = "") -> None:
        if not self.state.step:
            self._enter("choosing", now_s, f"{said} {speech.CHOOSING}".strip())
            return
        steps = [step.name for step in self.state.protocol.steps]
        count = None if self.state.protocol.grows else len(steps)
        asked = speech.asking(self.state.now(), steps.index(self.state.step) + 1, count)
        self._recent.moved = False
        self._enter("waiting", now_s, f"{said} {asked}".strip())

    def _end(self, phase: Phase, now_s: float, said: str) -> None:
        found = repeatability(self.state, self.limits)
        self.state.sentences = [
            *moved_since_start(self.state, self._ranges, self.limits),
            *([] if found is None else [found.sentence(self.limits)]),
        ]
        self._recent.forget()
        self._enter(phase, now_s, said)

    def _enter(self, phase: Phase, now_s: float, said: str) -> None:
        self.state.phase, self.state.since_s = phase, now_s
        self.state.say(said)

    def _leave(self, now_s: float) -> list[GloveReading]:
        """Count the running phase as capture time; the frames that were recorded in it."""
        if self.state.phase in RUNNING:
            self.state.capture_s += max(0.0, now_s - self.state.since_s)
        return self._recent.end()


Event = Literal["go", "redo", "undo", "skip", "pause", "resume", "stop"]
EVENTS: tuple[Event, ...] = get_args(Event)


class NotNow(BadInput):
    """The event has no meaning in this phase."""


class UserEvents(Transitions):
    def event(
        self, now_s: float, name: str, *, step: str | None = None, angle_deg: float | None = None
    ) -> None:
        """What the user wants. ``step`` and ``angle_deg`` are for ``redo``: which step, and the angle that
        its widget really has. Raises NotNow, BadInput for no event or step of that name; then nothing
        changed."""
        if name not in EVENTS:
            raise BadInput(f"no event {name!r}; {did_you_mean(name, EVENTS)}")
        if self.state.phase in OVER:
            raise NotNow(f"this sampling is {self.state.phase}; {name} comes too late")
        if self.state.phase == "paused" and name not in ("resume", "stop"):
            raise NotNow(f"the sampling is paused: resume it before {name}")
        if (step is not None or angle_deg is not None) and name != "redo":
            raise BadInput(f"{name} takes neither step nor angle; they are for redo")
        if name == "redo":
            self._redo(now_s, step, angle_deg)
        else:
            getattr(self, f"_{name}")(now_s)

    def _go(self, now_s: float) -> None:
        failed = self.state.phase == "judged" and not self.state.attempts[-1].counts
        if self.state.phase != "waiting" and not failed:
            raise NotNow(f"go has no meaning while the step is {self.state.phase}")
        self._enter("countdown", now_s, speech.COUNTDOWN)

    def _redo(self, now_s: float, name: str | None, angle_deg: float | None) -> None:
        if name is None and self.state.phase in ("waiting", "choosing"):
            done = [attempt.step for attempt in self.state.attempts if attempt.counts]
            if not done and angle_deg is None:
                raise NotNow("nothing was recorded yet that could be done again")
            name = done[-1] if done else self.state.step
        name = name or self.state.step
        step = self.state.protocol.step(name)
        if angle_deg is not None:
            self.state.protocol = _with_angle(self.state.protocol, step, angle_deg)
        self._leave(now_s)
        self.state.step = name
        self._ask(now_s)

    def _undo(self, now_s: float) -> None:
        """The last result is taken back; an earlier one of the same step counts again."""
        counted = [attempt for attempt in self.state.attempts if attempt.counts]
        if not counted:
            raise NotNow("there is nothing to undo")
        counted[-1].withdrawn = True
        self._leave(now_s)
        self._next(now_s, speech.UNDONE)

    def _skip(self, now_s: float) -> None:
        if not self.state.step:
            raise NotNow("there is nothing to leave out: the next step is being chosen")
        self._leave(now_s)
        self.state.attempts.append(Attempt(self.state.step, "skipped", ("the user left it out.",)))
        self._next(now_s, speech.SKIPPED)

    def _pause(self, now_s: float) -> None:
        self._leave(now_s)
        self._accept_verdict(now_s)
        if self.state.phase not in OVER:
            self._enter("paused", now_s, speech.PAUSED)

    def _resume(self, now_s: float) -> None:
        if self.state.phase not in ("paused", "lost"):
            raise NotNow(f"the sampling is not paused but {self.state.phase}")
        self._heard_s = None
        self._ask(now_s)

    def _stop(self, now_s: float) -> None:
        self._leave(now_s)
        self._end("stopped", now_s, speech.STOPPED)


def _with_angle(protocol: Protocol, step: Step, angle_deg: float) -> Protocol:
    """The widget of ``step`` has another angle; the step keeps its name."""
    if not abs(angle_deg) <= WIDEST_DEG:
        raise BadInput(f"a widget of {angle_deg:g} degrees; up to {WIDEST_DEG:g} are possible")
    if step.kind != "fk_cross_couple":
        raise BadInput(f"step {step.name} has no widget whose angle could be corrected")
    (rotation,) = step.angles
    widget = f"the {angle_deg:g} degree widget"
    ask, angles = step.ask.replace(step.needs, widget), {rotation: angle_deg}
    steps = [
        replace(each, angles=angles, ask=ask, needs=widget)
        if step.name in (each.name, each.repeats)
        else each
        for each in protocol.steps
    ]
    return replace(protocol, steps=tuple(steps))


def begin_sampling(
    protocol: Protocol,
    sensors: Sequence[str],
    *,
    trigger: Trigger = "key",
    counts: tuple[float, float] | None = None,
    now_s: float = 0.0,
) -> SamplingState:
    """A sampling at its first step. ``counts``: the smallest and largest reading of the hardware."""
    state = SamplingState(protocol, tuple(sensors), trigger, since_s=now_s)
    state.ranges = ActiveRanges.unknown(len(state.sensors), counts).to_document()
    state.step = state.first_unfinished()
    state.say(speech.asking(state.now(), 1, None if protocol.grows else len(protocol.steps)))
    return state


class Sampling(UserEvents):
    """Drives one ``state`` by time and frames; ``event`` is the user's."""

    def __init__(
        self,
        state: SamplingState,
        *,
        touch_check: TouchCheck | None = None,
        choose: Choose | None = None,
        limits: SamplingLimits = SAMPLING_LIMITS,
    ) -> None:
        super().__init__(state, limits)
        self._touch_check = touch_check
        self._choose = choose
        self._heard_since_s: float | None = None
        self._button = False

    def interrupted(self, now_s: float) -> None:
        """Taken up by another process: the frames of a running step are gone, so it begins again."""
        self._accept_verdict(now_s)
        if self.state.phase == "judged" or self.state.phase in RUNNING[1:]:
            self._ask(now_s, speech.INTERRUPTED)
        elif self.state.phase in ("waiting", "countdown", "choosing"):
            self.state.since_s = now_s

    def follow(self, state: SamplingState) -> None:
        """Go on with ``state``, which somebody else has changed; the frames stay."""
        if state.phase != self.state.phase or state.since_s != self.state.since_s:
            self._recent.end()
        self.state = state
        self._ranges = ActiveRanges.from_document(state.ranges)

    @property
    def steadiness_percent(self) -> float | None:
        """How far the hand moved in the last half second; still is ``still_percent`` or less."""
        return self._recent.percent(SETTLE_S, self._ranges)

    def frame(self, now_s: float, reading: GloveReading) -> None:
        """One frame, in the order they came; ones of another length are left out."""
        if self.state.phase in OVER or len(reading.values) != len(self.state.sensors):
            return
        silent = self._heard_s is None or now_s - self._heard_s > self.limits.back_after_s
        self._heard_since_s = now_s if silent else self._heard_since_s
        self._heard_s = now_s
        pressed, self._button = reading.button and not self._button, reading.button
        if self._recent.add(reading) and pressed:
            self._pressed(now_s)

    def _pressed(self, now_s: float) -> None:
        """The glove's own button, or a pedal on it, is the user's go."""
        try:
            self._go(now_s)
        except NotNow:
            return

    def tick(self, now_s: float) -> None:
        """Let time pass up to ``now_s``; call it often, also when no frame comes."""
        state = self.state
        if state.phase in (*OVER, "paused"):
            return
        if state.phase == "lost":
            self._wait_for_glove(now_s)
            return
        if self._is_lost(now_s):
            self._leave(now_s)
            self._accept_verdict(now_s)
            if state.phase not in OVER:
                self._enter("lost", now_s, speech.LOST)
            self._recent.forget()
            return
        waited = now_s - state.since_s
        if state.phase == "waiting":
            self._maybe_begin(now_s, waited)
        elif state.phase == "choosing":
            self._maybe_chosen(now_s)
        elif state.phase == "countdown" and waited >= COUNTDOWN_S and self.recording is not None:
            self._after_countdown(now_s)
        elif state.phase == "settling":
            self._maybe_settled(now_s, waited)
        elif state.phase == "recording":
            self._maybe_recorded(now_s)
        elif state.phase == "judged":
            self._after_verdict(now_s, waited)

    def _is_lost(self, now_s: float) -> bool:
        since = self.state.since_s if self._heard_s is None else max(self._heard_s, 0.0)
        return now_s - since > self.limits.lost_after_s

    def _wait_for_glove(self, now_s: float) -> None:
        heard, since = self._heard_s, self._heard_since_s
        if heard is None or since is None or now_s - heard > self.limits.back_after_s:
            return
        if heard - since >= self.limits.back_after_s:
            self._ask(now_s, speech.BACK)

    def _maybe_begin(self, now_s: float, waited: float) -> None:
        if not self._recent.moved:
            percent = self._recent.percent(SETTLE_S, self._ranges)
            moving = self.limits.moving_times_still * self.limits.still_percent
            self._recent.moved = percent is not None and percent > moving
        step, trigger = self.state.now(), self.state.trigger
        # A motion is not still, and a hand that waits for its widget is.
        by_hand = trigger == "still" and step.motion == "hold" and not step.needs
        if trigger != "key" and not by_hand and waited >= TIMER_S:
            self._enter("countdown", now_s, speech.COUNTDOWN)
        if by_hand and self._recent.moved and self.recording is not None:
            still = self._recent.percent(GESTURE_STILL_S, self._ranges)
            if still is not None and still <= self.limits.still_percent:
                self._record(now_s)

    def _after_countdown(self, now_s: float) -> None:
        self._leave(now_s)
        if self.state.now().motion == "hold":
            self._enter("settling", now_s, speech.SETTLING)
        else:
            self._record(now_s)

    def _maybe_settled(self, now_s: float, waited: float) -> None:
        percent = self.steadiness_percent if waited >= SETTLE_S else None
        if percent is not None and percent <= self.limits.still_percent:
            self._leave(now_s)
            self._record(now_s)
        elif waited > self.limits.settle_timeout_s:
            self._leave(now_s)
            moving = "no frames to judge by" if percent is None else f"{percent:.0f} % of a sensor's range"
            self._judged(now_s, Attempt(
                self.state.step, "bad", (f"the hand did not come to rest ({moving} in {SETTLE_S:g} s).",)
            ))  # fmt: skip

    def _record(self, now_s: float) -> None:
        self._recent.begin()
        self._enter("recording", now_s, speech.recording(self.state.now()))

    def _after_verdict(self, now_s: float, waited: float) -> None:
        """A good step goes over into the next; a bad one waits for the user, if there is one to wait for."""
        if self.state.attempts[-1].counts:
            if waited >= SHOWN_S:
                self._next(now_s)
        elif self.state.trigger != "key" and waited >= TIMER_S:
            self._ask(now_s)

    def _maybe_recorded(self, now_s: float) -> None:
        over = now_s - self.state.since_s >= self.state.now().seconds
        # A glove that fell silent may be lost: that verdict comes first.
        if over and self._heard_s is not None and now_s - self._heard_s <= self.limits.back_after_s:
            readings = self._leave(now_s)
            attempt = verdict(
                self.state, readings, self._ranges, self.recording or "", self._touch_check, self.limits
            )
            self.state.ranges = self._ranges.to_document()
            self._judged(now_s, attempt)

    def _maybe_chosen(self, now_s: float) -> None:
        chosen = None if self._choose is None else self._choose(self.state)
        if chosen is None:
            return
        protocol = self.state.protocol
        self.state.protocol = replace(
            protocol, steps=(*protocol.steps, *chosen.steps), grows=not chosen.are_last
        )
        self.state.expected = chosen.document
        self._next(now_s, chosen.sentence)
