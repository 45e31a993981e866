"""What is said aloud: one short sentence for each event."""

from __future__ import annotations

from glovecal_models.sampling.protocol import Step


def asking(step: Step, place: int, count: int | None) -> str:
    """``count`` None: nobody knows how many there will be."""
    return f"Step {place}{f' of {count}' if count else ''}. {step.ask}"


def recording(step: Step) -> str:
    return "Hold still." if step.motion == "hold" else "Now move."


def again(reasons: tuple[str, ...]) -> str:
    return f"Once more: {reasons[0]}"


COUNTDOWN = "Ready."
SETTLING = "Keep still."
GOOD = "Good."
LOST = "The glove is gone. I wait for it."
BACK = "The glove is back."
PAUSED = "Pause."
SKIPPED = "Left out."
UNDONE = "Taken back."
CHOOSING = "One moment."
DONE = "Done. Thank you."
STOPPED = "Stopped."
INTERRUPTED = "The service was interrupted; this step begins again."
