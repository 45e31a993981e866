"""What the operating system gives to the service alone, on Linux, macOS and Windows.

The rest is in ``glovecal_client.operating_system``, where the facts of locks, stops and files stand. Here:

* Priority: Linux gives every thread a niceness, macOS every process; below 0 is for root. Windows has classes
  of processes (SetPriorityClass) and, within them, priorities of threads (SetThreadPriority). Everybody may
  ask for ABOVE_NORMAL; HIGH would keep the computer's other programs waiting.
* Stop: a process in a group of its own hears CTRL_BREAK_EVENT alone, and no Ctrl-C of its console.
* Open files: shells give a process 256 (macOS) or 1,024 (Linux), and it may take up to a limit of thousands
  by itself; each connection is one. Windows has no such limit.
* Memory: Linux makes files that have no place on a disk (``memfd_create``).
* Fork: only the libraries of Linux survive it.
* Keys: ``termios`` is of POSIX. Windows has ``msvcrt.getwch`` for its console, where a special key is two
  characters, the first NUL or U+00E0.
"""

from __future__ import annotations

import multiprocessing
import os
import select
import shlex
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO, BinaryIO

from glovecal_client.clock import clock_s

FORKS = sys.platform == "linux"
"""Whether a process may be forked from one that has imported libraries."""
FIRST, BEHIND = -10, 10
"""Nicenesses of real time and of training."""
_ABOVE_NORMAL_CLASS, _BELOW_NORMAL_CLASS, _BELOW_NORMAL_THREAD = 0x8000, 0x4000, -1
_LOOK_S = 0.02
_OPEN_FILES = 10_240


def children_context():
    """Of ``multiprocessing``: forked children have what this process has imported, spawned ones nothing."""
    if sys.platform == "linux":
        return multiprocessing.get_context("fork")
    return multiprocessing.get_context("spawn")


def memory_file() -> BinaryIO | None:
    """A file without a name that lies in memory alone and goes with its process, also on kill -9; None where
    the system has none."""
    if sys.platform == "linux":
        return os.fdopen(os.memfd_create("glovecal"), "w+b")
    return None


def folder_in_memory() -> str | None:
    """A folder for everybody, whose files lie in memory; None where there is none."""
    place = "/dev/shm"
    return place if sys.platform == "linux" and os.access(place, os.W_OK | os.X_OK) else None


def path_of(file: BinaryIO) -> Path:
    """By which this process, and others of its user, open a ``memory_file`` as long as it is open here."""
    return Path(f"/proc/{os.getpid()}/fd/{file.fileno()}")


def open_many_files() -> None:
    """Take as many open files as this process may have, for itself and its children."""
    if sys.platform == "win32":
        return
    import resource

    least, most = resource.getrlimit(resource.RLIMIT_NOFILE)
    wanted = _OPEN_FILES if most == resource.RLIM_INFINITY else min(most, _OPEN_FILES)
    if least != resource.RLIM_INFINITY and least < wanted:
        with suppress(OSError, ValueError):  # macOS says that it has no limit, and has one
            resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, most))


def go_first() -> None:
    """Run this process before training and everything else, where its user may (root or CAP_SYS_NICE)."""
    if sys.platform == "win32":
        _set_class(_ABOVE_NORMAL_CLASS)
    else:
        with suppress(OSError):
            os.setpriority(os.PRIO_PROCESS, 0, FIRST)


def step_back() -> None:
    """Leave the live stream its time, for this process; it stays so."""
    if sys.platform == "win32":
        _set_class(_BELOW_NORMAL_CLASS)
    else:
        os.nice(max(0, BEHIND - os.nice(0)))  # a command that was begun behind stays there


def step_back_in_this_thread() -> None:
    """As ``step_back``, but the other threads answer as before; macOS has that for whole processes only."""
    if sys.platform == "win32":
        import ctypes

        kernel = ctypes.WinDLL("kernel32")
        kernel.SetThreadPriority(ctypes.c_void_p(kernel.GetCurrentThread()), _BELOW_NORMAL_THREAD)
    elif sys.platform == "linux":
        thread = threading.get_native_id()
        os.setpriority(os.PRIO_PROCESS, thread, max(BEHIND, os.getpriority(os.PRIO_PROCESS, thread)))
    else:
        step_back()


def _set_class(priority: int) -> None:
    if sys.platform == "win32":
        import ctypes

        kernel = ctypes.WinDLL("kernel32")
        kernel.SetPriorityClass(ctypes.c_void_p(kernel.GetCurrentProcess()), priority)


def start_process(
    command: Sequence[str], environment: Mapping[str, str], output: IO[bytes]
) -> subprocess.Popen[bytes]:
    """A process that ``ask_to_stop`` can ask; what it says goes to ``output``."""
    group = subprocess.CREATE_NEW_PROCESS_GROUP if sys.platform == "win32" else 0
    return subprocess.Popen(
        command, env=environment, stdout=output, stderr=subprocess.STDOUT, creationflags=group
    )


def ask_to_stop(process: subprocess.Popen[bytes]) -> None:
    """It may finish what it does; harmless when it has ended."""
    if sys.platform == "win32":
        with suppress(OSError):  # ended, or there is no console
            process.send_signal(signal.CTRL_BREAK_EVENT)
    else:
        process.terminate()


def has_display() -> bool:
    """Whether a browser would open a window: else it could take over the terminal."""
    if sys.platform in ("darwin", "win32"):
        return True
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


@contextmanager
def single_keys() -> Iterator[Callable[[float], str]]:
    """A function that waits so many seconds for a key and returns it, "" for none.

    The terminal is as it was afterwards. Where there is none, no key ever comes.
    """
    if not sys.stdin.isatty():
        yield _nobody
    elif sys.platform == "win32":
        yield _pressed_in_console
    else:
        import termios
        import tty

        stream = sys.stdin.fileno()
        before = termios.tcgetattr(stream)
        tty.setcbreak(stream)
        try:
            yield _pressed_in_terminal
        finally:
            termios.tcsetattr(stream, termios.TCSADRAIN, before)


def _nobody(timeout_s: float) -> str:
    time.sleep(timeout_s)
    return ""


def _pressed_in_terminal(timeout_s: float) -> str:
    stream = sys.stdin.fileno()
    ready, _, _ = select.select([stream], [], [], timeout_s)
    return os.read(stream, 1).decode(errors="replace") if ready else ""


def _pressed_in_console(timeout_s: float) -> str:
    """Asked again and again: ``select`` takes sockets only there. Ctrl-C raises, as anywhere."""
    if sys.platform != "win32":
        return ""
    import msvcrt

    until = clock_s() + timeout_s
    while not msvcrt.kbhit():
        if (left := until - clock_s()) <= 0:
            return ""
        time.sleep(min(_LOOK_S, left))
    key = msvcrt.getwch()
    if key == "\x03":
        raise KeyboardInterrupt
    if key in "\x00\xe0" and msvcrt.kbhit():
        msvcrt.getwch()
        return ""
    return key


def as_typed(file: Path) -> str:
    """The name of a file as it is typed at the end of a command: a folder's name may have blanks."""
    return subprocess.list2cmdline([str(file)]) if sys.platform == "win32" else shlex.quote(str(file))
