"""The one place between the thread that reads pictures and the one that tracks: the newest wins."""

from __future__ import annotations

import threading
from dataclasses import dataclass

from glovecal_client.pictures.source import Picture


@dataclass(frozen=True, eq=False)
class NumberedPicture:
    """A picture of this run, and the times that its pose gets."""

    number: int
    picture: Picture
    monotonic_ns: int
    """By this computer's clock: as the picture says, or when a recorded one was due."""
    wall_ns: int


class NewestPicture:
    """Holds one picture; another that comes before it was taken replaces it, and that is counted."""

    def __init__(self) -> None:
        self.skipped = 0
        """Pictures that were replaced."""
        self._held: NumberedPicture | None = None
        self._is_over = False
        self._changed = threading.Condition()

    def put(self, picture: NumberedPicture) -> None:
        with self._changed:
            self.skipped += self._held is not None
            self._held = picture
            self._changed.notify_all()

    def take(self, timeout_s: float) -> NumberedPicture | None:
        """The picture held, None when none came in time."""
        with self._changed:
            self._changed.wait_for(lambda: self._held is not None or self._is_over, timeout_s)
            taken, self._held = self._held, None
            return taken

    def end(self) -> None:
        """No more will come."""
        with self._changed:
            self._is_over = True
            self._changed.notify_all()

    @property
    def is_over(self) -> bool:
        """Whether nothing is held and no more will come."""
        with self._changed:
            return self._is_over and self._held is None

    @property
    def waiting(self) -> int:
        with self._changed:
            return int(self._held is not None)
