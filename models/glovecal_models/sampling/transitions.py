"""How a sampling goes from one phase into another."""

from __future__ import annotations

from glovecal_models.sampling import speech
from glovecal_models.sampling.attempt import Attempt
from glovecal_models.sampling.reading import GloveReading
from glovecal_models.sampling.recent import RecentReadings
from glovecal_models.sampling.state import RUNNING, Phase, SamplingState
from glovecal_models.sampling.steadiness import ActiveRanges
from glovecal_models.sampling.verification import moved_since_start


class Transitions:
    """What happens to one ``state``. Times are seconds of one clock that does not go back."""

    def __init__(self, state: SamplingState) -> None:
        self.state = state
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
        self.state.sentences = moved_since_start(self.state, self._ranges)
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
