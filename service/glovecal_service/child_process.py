"""A program that the service starts beside itself, and that never outlives it.

Its standard input is a pipe on which nothing is ever sent. That ends when the service wants the program to
stop, and when the service is gone, whatever ended it.
"""

from __future__ import annotations

import os
import subprocess
import sys
import threading
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager

from glovecal_client.program import stopped_by_signals

ENDS_WITHIN_S = 10.0
_MOST_SENTENCES, _LONGEST_SENTENCE = 50, 500


class ChildProcess:
    """In the service: the program ``python -m MODULE ARGUMENTS``, and what it says on standard error."""

    def __init__(self, module: str, *arguments: str, what: str) -> None:
        """``what`` is named where the program has to be killed: "the camera"."""
        self._what = what
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-m", module, *arguments],
            stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
        )  # fmt: skip
        self._sentences: deque[str] = deque(maxlen=_MOST_SENTENCES)
        self._listening = threading.Thread(target=self._listen, daemon=True)
        self._listening.start()

    @property
    def is_on(self) -> bool:
        return self._process.poll() is None

    @property
    def sentence(self) -> str:
        """The last that it wrote; "" before it wrote anything."""
        return self._sentences[-1] if self._sentences else ""

    def end(self) -> None:
        """Ask it to stop; it is killed where it hangs. Harmless once it has ended."""
        assert self._process.stdin is not None
        self._process.stdin.close()
        try:
            self._process.wait(ENDS_WITHIN_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
            self._sentences.append(f"{self._what} hangs; its process was ended after {ENDS_WITHIN_S:g} s")
        self._listening.join(ENDS_WITHIN_S)

    def _listen(self) -> None:
        assert self._process.stderr is not None
        with self._process.stderr as lines:
            for line in lines:
                if text := line.decode(errors="replace").strip():
                    self._sentences.append(text[:_LONGEST_SENTENCE])


@contextmanager
def stopped_with_the_service() -> Iterator[threading.Event]:
    """In the program: an event that is set when it has to stop, by its standard input or by a signal."""
    stop = threading.Event()

    def wait_for_the_end() -> None:
        while os.read(0, 4096):  # not sys.stdin: its lock must be free when the process ends otherwise
            pass
        stop.set()

    threading.Thread(target=wait_for_the_end, daemon=True).start()
    with stopped_by_signals(stop, outlives_terminal=True):
        yield stop
