"""What the user may want in the middle of a sampling, and when it has a meaning."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal, get_args

from glovecal_models.errors import BadInput
from glovecal_models.sampling import speech
from glovecal_models.sampling.attempt import Attempt
from glovecal_models.sampling.protocol import Protocol
from glovecal_models.sampling.state import OVER
from glovecal_models.sampling.step import Step
from glovecal_models.sampling.transitions import Transitions
from glovecal_models.sampling.widgets import WIDEST_DEG

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
            raise BadInput(f"no event {name!r}; there are {', '.join(EVENTS)}")
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
    changed = replace(
        step, angles={rotation: angle_deg}, ask=step.ask.replace(step.needs, widget), needs=widget
    )
    return replace(protocol, steps=tuple(changed if each is step else each for each in protocol.steps))
