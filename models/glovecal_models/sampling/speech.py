"""What is said aloud: one short sentence for each event."""

from __future__ import annotations

from glovecal_models.sampling.protocol import Step


def asking(step: Step, place: int, count: int | None) -> str:
    """``count`` None: nobody knows how many there will be."""
    return f"Step {place}{f' of {count}' if count else ''}. {step.ask}"


def recording(step: Step) -> str:
    return "Hold still." if step.motion == "hold" else "Now move."


def again(reasons: tuple[str, ...]) -> str:
    return f"Repeat: {reasons[0]}"


COUNTDOWN = "Ready."
SETTLING = "Keep still."
GOOD = "Good."
LOST = "Signal lost, waiting for the glove."
BACK = "Signal restored."
PAUSED = "Paused."
SKIPPED = "Skipped."
UNDONE = "Undone."
CHOOSING = "Choosing the next step."
DONE = "Done. Thank you."
STOPPED = "Stopped."
INTERRUPTED = "The service was interrupted; repeating this step."
