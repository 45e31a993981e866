"""A process on a terminal of its own: what it says is read, keys are typed, Ctrl-C reaches all of it."""

from __future__ import annotations

import os
import pty
import select
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager

BECOME = """
import fcntl, os, sys, termios
fcntl.ioctl(0, termios.TIOCSCTTY, 0)
os.execv(sys.argv[1], sys.argv[1:])
"""
CTRL_C = "\x03"


class OnTerminal:
    """``said`` is everything that stood on the terminal so far."""

    def __init__(self, process: subprocess.Popen[bytes], terminal: int) -> None:
        self.process = process
        self.said = ""
        self._terminal = terminal

    def type(self, keys: str) -> None:
        os.write(self._terminal, keys.encode())

    def wait_for(self, text: str, deadline_s: float = 120.0) -> None:
        end = time.monotonic() + deadline_s
        while text not in self.said:
            assert time.monotonic() < end, f"{text!r} was not said in {deadline_s} s: {self.said}"
            assert self._read(0.2) or self.process.poll() is None, f"{text!r} was never said: {self.said}"

    def hang_up(self) -> None:
        """Close the terminal, as when its window or its connection is closed."""
        if self._terminal >= 0:
            os.close(self._terminal)
        self._terminal = -1

    def end(self, deadline_s: float = 60.0) -> int:
        """The exit code, once the process has ended."""
        end = time.monotonic() + deadline_s
        while self.process.poll() is None:
            assert time.monotonic() < end, f"still running after {deadline_s} s: {self.said}"
            self._read(0.2)
        while self._read(0.0):
            pass
        return self.process.returncode

    def _read(self, timeout_s: float) -> bool:
        if self._terminal < 0:
            time.sleep(min(timeout_s, 0.02))
            return False
        if not select.select([self._terminal], [], [], timeout_s)[0]:
            return False
        try:
            read = os.read(self._terminal, 65536)
        except OSError:  # Linux: nobody has the other end any more
            return False
        self.said += read.decode(errors="replace").replace("\r\n", "\n")
        return bool(read)


@contextmanager
def on_terminal(command: Sequence[str], environment: Mapping[str, str]) -> Iterator[OnTerminal]:
    """The command leads a session whose terminal is ours to type on; it is ended with the block."""
    ours, theirs = pty.openpty()
    process = subprocess.Popen(
        [sys.executable, "-c", BECOME, *command],
        stdin=theirs,
        stdout=theirs,
        stderr=theirs,
        env=dict(environment),
        start_new_session=True,
    )
    os.close(theirs)
    terminal = OnTerminal(process, ours)
    try:
        yield terminal
    finally:
        process.kill()
        process.wait()
        terminal.hang_up()
