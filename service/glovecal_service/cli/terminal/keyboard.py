"""Single keys from a terminal, without Enter and without waiting."""

from __future__ import annotations

import os
import select
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager


@contextmanager
def single_keys() -> Iterator[Callable[[float], str]]:
    """A function that waits so many seconds for a key and returns it, "" for none.

    The terminal is as it was afterwards. Where there is none, no key ever comes.
    """
    import termios
    import tty

    if not sys.stdin.isatty():
        yield _nobody
        return
    stream = sys.stdin.fileno()
    before = termios.tcgetattr(stream)
    tty.setcbreak(stream)
    try:
        yield _pressed
    finally:
        termios.tcsetattr(stream, termios.TCSADRAIN, before)


def _pressed(timeout_s: float) -> str:
    stream = sys.stdin.fileno()
    ready, _, _ = select.select([stream], [], [], timeout_s)
    return os.read(stream, 1).decode(errors="replace") if ready else ""


def _nobody(timeout_s: float) -> str:
    select.select([], [], [], timeout_s)
    return ""
