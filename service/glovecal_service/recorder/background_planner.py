"""Choosing the next step in a thread of its own: frames do not wait for it."""

from __future__ import annotations

from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any

from glovecal_models.sampling.state import Choose, NextSteps, SamplingState


class BackgroundPlanner:
    """A ``Choose`` that answers None until ``choose`` has an answer for the state as it is."""

    def __init__(self, choose: Choose) -> None:
        self._choose = choose
        self._worker = ThreadPoolExecutor(1, thread_name_prefix="next-step")
        self._asked: tuple[Any, ...] | None = None
        self._answer: Future[NextSteps | None] | None = None

    def __call__(self, state: SamplingState) -> NextSteps | None:
        """Raises what ``choose`` raises."""
        asked = _mark(state)
        if self._answer is None or asked != self._asked:
            copy = SamplingState.from_document(state.to_document())
            self._asked, self._answer = asked, self._worker.submit(self._choose, copy)
        return self._answer.result() if self._answer.done() else None

    def close(self) -> None:
        self._worker.shutdown(wait=False, cancel_futures=True)


def _mark(state: SamplingState) -> tuple[Any, ...]:
    """Differs when the answer may."""
    return (len(state.protocol.steps), *((each.step, each.counts) for each in state.attempts))
