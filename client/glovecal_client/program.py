"""What every program of ours does around its work: standard streams, exit code, and signals to stop.

Left to itself, Python ends with exit code 120 where a stream was closed, its disk is full, or its reader or
terminal is gone.
"""

from __future__ import annotations

import atexit
import errno
import gc
import io
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from queue import Full, Queue
from threading import Thread
from typing import Any, NoReturn, TextIO

from glovecal_client.operating_system import CONSOLE_SIGNALS, HANG_UP, STOP_SIGNALS

READER_GONE = (errno.EPIPE, errno.EIO, errno.EINVAL)
"""A closed pipe (EINVAL on Windows), a terminal that hung up: nobody is left to be told."""
ANSWER_LOST = 1
MOST_WAITING = 2000
"""Lines that nobody has read yet."""
SETTLED_WITHIN_S = 1.0


class AnswerLost(BrokenPipeError):
    """Standard output did not take what a command answers. Told already, if there is somebody to tell."""


def run_command(command: Callable[[], int | None]) -> NoReturn:
    """Run ``command`` as all of this process's work; ends in SystemExit with its exit code.

    The code is 1 where the command went well and its answer was lost.
    """
    guard_streams()
    atexit.register(gc.freeze)  # else Python looks through all there is for cycles before it ends
    code: Any = ANSWER_LOST
    try:
        code = command()
    except SystemExit as end:
        code = end.code
    except AnswerLost:
        pass
    finally:
        delivered = _flush()
    sys.exit(code or (0 if delivered else ANSWER_LOST))


def leave_at_once(code: int) -> NoReturn:
    """End this process, waiting for no thread: one that hangs must not turn a clean end into a crash."""
    delivered = _flush()
    os._exit(code or (0 if delivered else ANSWER_LOST))


def guard_streams() -> None:
    """Standard error never fails. Standard output fails once, by AnswerLost, and is silent from then on.

    A stream that was closed before the start never fails either, and no file of ours gets its number.
    """
    for number in (0, 1, 2):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # takes the lowest number that is free
    sys.stdin = sys.stdin or open(0, closefd=False, encoding="locale")  # noqa: SIM115
    sys.stdout = _guarded(sys.stdout or open(1, "w", closefd=False, encoding="locale"), _lose_answer)  # noqa: SIM115
    sys.stderr = _guarded(sys.stderr or open(2, "w", closefd=False, encoding="locale"), _ignore)  # noqa: SIM115


def never_wait() -> Callable[[], None]:
    """From now on nothing waits for standard error, which a thread of its own writes.

    Its reader may stand still: a pipe that nobody empties, a terminal stopped by Ctrl-S, a Windows console in
    which somebody marks text. Lines then wait in memory; when there are too many the newest are left out, and
    that is told as soon as somebody reads again. For processes that must go on: lines may come out after what
    was printed later on standard output. Nothing changes where ``guard_streams`` was not called: the stream
    is not ours. What is returned waits until all is written; an exit of the interpreter does, the end of a
    process of ``multiprocessing`` does not.
    """
    stream = sys.stderr
    if not isinstance(getattr(getattr(stream, "buffer", None), "raw", None), _Guard):
        return lambda: None
    raw = _Patient(stream, _ignore)
    sys.stderr = io.TextIOWrapper(
        io.BufferedWriter(raw), encoding=stream.encoding, errors=stream.errors, line_buffering=True
    )
    atexit.register(raw.settle)
    return raw.settle


def say(sentence: str) -> None:
    """Print a sentence on standard output that the command's success does not depend on."""
    with suppress(AnswerLost):
        print(sentence, flush=True)


def _flush() -> bool:
    try:
        sys.stdout.flush()
    except AnswerLost:
        return False
    return True


def _ignore(error: OSError) -> None:
    pass


def _lose_answer(error: OSError) -> NoReturn:
    if error.errno not in READER_GONE:
        print(f"Standard output cannot be written: {error.strerror}.", file=sys.stderr)
    raise AnswerLost(errno.EPIPE, os.strerror(errno.EPIPE)) from error


class _Guard(io.RawIOBase):
    """The raw end of a standard stream. Its first failed write calls ``failed``; later ones are dropped."""

    def __init__(self, stream: TextIO, failed: Callable[[OSError], None]) -> None:
        self._stream = stream  # which would close the raw one
        raw = getattr(stream.buffer, "raw", stream.buffer)  # python -u: there is no buffer
        # past another guard: in a process that was forked the thread that writes for it is not there
        self._raw = raw._raw if isinstance(raw, _Guard) else raw
        self._failed, self._lost = failed, False

    def write(self, data: Any, /) -> int | None:
        if not self._lost:
            try:
                return self._raw.write(data)
            except OSError as error:
                self._lost = True
                self._failed(error)
        return len(data)

    def writable(self) -> bool:
        return True

    def fileno(self) -> int:
        return self._raw.fileno()

    def isatty(self) -> bool:
        return self._raw.isatty()


class _Patient(_Guard):
    """One that takes no time: a thread writes, past the stream's buffer: its lock is wanted at the end."""

    def __init__(self, stream: TextIO, failed: Callable[[OSError], None]) -> None:
        super().__init__(stream, failed)
        self._waiting: Queue[bytes] = Queue(MOST_WAITING)
        self._left_out = 0
        Thread(target=self._write_on, name="standard error", daemon=True).start()

    def write(self, data: Any, /) -> int:
        try:
            self._tell_left_out()
            self._waiting.put_nowait(bytes(data))
        except Full:
            self._left_out += 1
        return len(data)

    def _tell_left_out(self) -> None:
        if self._left_out:
            told = f"({self._left_out} lines were left out here: nobody read them.)\n"
            self._waiting.put_nowait(told.encode())
            self._left_out = 0

    def settle(self) -> None:
        """Wait until all is written, but not for a reader that stands still."""
        until = time.monotonic() + SETTLED_WITHIN_S
        while (self._waiting.unfinished_tasks or self._left_out) and time.monotonic() < until:
            with suppress(Full):
                self._tell_left_out()
            time.sleep(0.01)

    def _write_on(self) -> None:
        while True:
            data = self._waiting.get()
            while data:
                written = super().write(data)
                data = data[written or 0 :]
                if not written:  # a pipe that does not block, and is full
                    time.sleep(0.01)
            self._waiting.task_done()


def _guarded(stream: TextIO, failed: Callable[[OSError], None]) -> TextIO:
    """The stream with a guard at its end; a sign that its encoding lacks becomes a question mark."""
    assert isinstance(stream, io.TextIOWrapper)
    return io.TextIOWrapper(
        io.BufferedWriter(_Guard(stream, failed)),
        encoding=stream.encoding,
        errors="replace" if stream.errors == "strict" else stream.errors,
        line_buffering=stream.line_buffering,
        write_through=stream.write_through,
    )


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
