"""Signals that ask a command to stop, and the one of a terminal that was closed."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from glovecal_client.operating_system import CONSOLE_SIGNALS, HANG_UP, STOP_SIGNALS

Handler = Callable[[int, Any], Any]


def handle_signals(handler: Handler | signal.Handlers, *numbers: int) -> dict[int, Any]:
    """Handle these signals from now on; returns the handlers there were. Main thread only.

    A signal that is ignored stays ignored: so ``nohup`` and scripts' background jobs are told to go on.
    """
    before: dict[int, Any] = {}
    for number in numbers:
        if signal.getsignal(number) is not signal.SIG_IGN:
            before[number] = signal.signal(number, handler)
    return before


def leave_signals_to_the_parent() -> None:
    """A terminal sends them to every process in it; the one that began this one says when it ends."""
    handle_signals(signal.SIG_IGN, *CONSOLE_SIGNALS, *HANG_UP)


@contextmanager
def stopped_by_signals(stop: threading.Event, *, outlives_terminal: bool = False) -> Iterator[None]:
    """Signals that ask to stop set ``stop``; with ``outlives_terminal`` closing the terminal ends nothing."""
    before = handle_signals(lambda *_: stop.set(), *STOP_SIGNALS)
    if outlives_terminal:
        before |= handle_signals(signal.SIG_IGN, *HANG_UP)
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
