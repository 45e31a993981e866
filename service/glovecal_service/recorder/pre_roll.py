"""The frames before a recording: what effects with a memory need to know of the time before it.

They lie in the capture daemon's log and are fetched from there, newest first, in a thread of their own: the
recording's own frames never wait for them.
"""

from __future__ import annotations

import threading
from queue import Empty, Full, Queue

import zenoh

from glovecal_client.errors import NoAnswer, WireError
from glovecal_client.gap_repair import fetch_frames
from glovecal_client.keys import GloveKeys
from glovecal_client.wire.frame import Frame
from glovecal_models.effects.base.history_effect import LONGEST_GAP_S
from glovecal_service.plain import reason_of

BLOCK_FRAMES = 512
MOST_FRAMES = 120_000
"""Ten minutes at 200 Hz."""
PAUSE_S = 0.02
"""Between two blocks: capture has its glove to read."""
TRY_AGAIN_AFTER_S = 2.0
ANSWER_WITHIN_S = 2.0


class PreRoll:
    """Fetches what comes before ``oldest`` in its run, back to ``from_ns`` of the run's monotonic clock.

    It ends where the run began, and at a pause after which effects with a memory start anew.
    """

    def __init__(self, session: zenoh.Session, keys: GloveKeys, oldest: Frame, from_ns: int) -> None:
        self._session = session
        self._keys = keys
        self._oldest = oldest
        self._from_ns = from_ns
        self._left = MOST_FRAMES
        self._ended: str | None = None if oldest.sequence else "the run began then"
        """Why nothing comes before, "" where it reaches back far enough; None while it is fetched."""
        self._trouble = ""
        self._fetched: Queue[list[Frame]] = Queue(maxsize=2)
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="pre-roll", daemon=True)
        self._thread.start()

    @property
    def why_shorter(self) -> str:
        """A clause on why the pre-roll does not reach back to ``from_ns``; "" when it does."""
        return self._ended if self._ended is not None else self._trouble or "the rest was not fetched"

    @property
    def goes_on(self) -> bool:
        """Whether more can be expected soon: there is some, or capture answers."""
        fetching = self._thread.is_alive()
        return not self._fetched.empty() or (fetching and not self._trouble)

    def take(self) -> list[Frame]:
        """Some of the frames fetched, newest first, flagged as repaired; does not wait."""
        try:
            return self._fetched.get_nowait()
        except Empty:
            return []

    def stop(self, why: str | None = None) -> None:
        """Fetch no more, because of ``why``. The thread ends with the answer to its last question."""
        if why is not None:
            self._ended = why
        self._stop.set()

    def wait(self) -> None:
        """Wait for the thread after ``stop``: from then on the session may be closed."""
        self._thread.join(2 * ANSWER_WITHIN_S)

    def _run(self) -> None:
        while self._ended is None and not self._stop.is_set():
            try:
                block = self._ask()
            except (NoAnswer, WireError, zenoh.ZError) as error:
                self._trouble = f"capture's log did not give more: {reason_of(error)}"
                self._stop.wait(TRY_AGAIN_AFTER_S)
            else:
                self._trouble = ""
                self._hand_over(self._wanted(block))
                self._stop.wait(PAUSE_S)

    def _ask(self) -> list[Frame]:
        before = self._oldest.sequence
        first = max(0, before - min(BLOCK_FRAMES, self._left))
        return fetch_frames(
            self._session, self._keys.site, self._keys.glove, self._oldest.run_id, first, before - 1,
            timeout_s=ANSWER_WITHIN_S,
        )  # fmt: skip

    def _wanted(self, block: list[Frame]) -> list[Frame]:
        """The frames of ``block`` that belong to the pre-roll, newest first."""
        kept = []
        for frame in reversed(block):
            if frame.monotonic_ns < self._from_ns:
                self._ended = ""
                break
            pause_s = (self._oldest.monotonic_ns - frame.monotonic_ns) / 1e9
            if not 0.0 < pause_s <= LONGEST_GAP_S:
                self._ended = f"before that the glove was silent for {pause_s:.1f} s"
                break
            kept.append(frame)
            self._oldest = frame
        self._left -= len(kept)
        if self._ended is None and self._oldest.sequence == 0:
            self._ended = "the run began then"
        elif self._ended is None and self._left <= 0:
            self._ended = f"more than {MOST_FRAMES} frames are not taken"
        return kept

    def _hand_over(self, frames: list[Frame]) -> None:
        while not self._stop.is_set():
            try:
                self._fetched.put(frames, timeout=0.2)
            except Full:
                continue
            return
