"""How many frames one turn may hold so that it ends within a time budget."""

from __future__ import annotations

_GROWTH = 1.5


class Pace:
    """Learns what a frame costs, from the cautious side.

    It believes a faster turn at once and a slower one little by little: a single slow turn, as when the
    process was set aside, must not make it skip frames.
    """

    def __init__(self, seconds_per_frame: float = 5e-3) -> None:
        self.seconds_per_frame = seconds_per_frame

    def observe(self, frames: int, seconds: float) -> None:
        """A turn of ``frames`` took ``seconds``."""
        if frames > 0:
            self.seconds_per_frame = max(1e-6, min(seconds / frames, self.seconds_per_frame * _GROWTH))

    def frames_within(self, seconds: float) -> int:
        """At least one frame: something must go on."""
        return max(1, int(seconds / self.seconds_per_frame))
