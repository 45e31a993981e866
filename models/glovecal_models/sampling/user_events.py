"""How a sampling goes from one phase into another, and what the user may want in the middle of it."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal, get_args

from glovecal_models.errors import BadInput
from glovecal_models.names import did_you_mean
from glovecal_models.sampling import speech
from glovecal_models.sampling.limits import SAMPLING_LIMITS, SamplingLimits
from glovecal_models.sampling.protocol import Protocol, Step
from glovecal_models.sampling.quality import moved_since_start
from glovecal_models.sampling.reading import ActiveRanges, GloveReading, RecentReadings
from glovecal_models.sampling.repeatability import repeatability
from glovecal_models.sampling.state import OVER, RUNNING, Attempt, Phase, SamplingState
from glovecal_models.sampling.steps import WIDEST_DEG


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
