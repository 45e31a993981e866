"""What the operating system gives to the client, on Linux, macOS and Windows; the service uses it too.

No other module here asks which system it runs on. The ways of Windows and macOS follow their documentation:

* Locks: ``flock(2)`` goes with the process. ``msvcrt.locking`` (LockFile) does too, though "the time it takes
  depends upon available system resources", and nobody else can read the byte: a lock file holds nothing.
* Disk: ``fsync(2)`` of macOS hands data to the drive, ``F_FULLFSYNC`` has the drive write it. Windows opens
  no folder to sync it; MoveFileEx with MOVEFILE_WRITE_THROUGH "does not return until the file is actually
  moved on the disk". It is denied while anybody, such as a virus scanner, has either file open.
* Stop: nothing sends SIGTERM on Windows (``Popen.terminate`` is TerminateProcess: no handler runs, nothing is
  flushed). CTRL_BREAK_EVENT comes as SIGBREAK to all processes of a group that share the sender's console.
* Ports: on Windows SO_REUSEADDR lets two programs listen at one port, SO_EXCLUSIVEADDRUSE keeps it to one;
  elsewhere SO_REUSEADDR only skips the wait for old connections.
* Boot: Linux names each boot in ``boot_id``, macOS in ``kern.bootsessionuuid``; Windows counts them in its
  registry (``BootId``, undocumented).
* Serial: the driver of an FTDI adapter keeps bytes back for its latency timer, 16 ms at first. On Linux
  pyserial sets it, on Windows an administrator does; everybody reads it in the registry, below FTDIBUS.
* Files: only the owner's on Linux and macOS by their mode; Windows has lists that a folder passes on.
* Names: Windows keeps CON, COM1 and others for devices, also before a dot, forbids some characters and drops
  a dot or blank at the end.
"""

from __future__ import annotations

import errno
import os
import re
import signal
import socket
import subprocess
import sys
import time
from contextlib import suppress
from io import FileIO, RawIOBase
from pathlib import Path
from typing import IO, Any

CONSOLE_SIGNALS: tuple[signal.Signals, ...] = (signal.SIGINT,)
"""Sent by a terminal to all processes that were started in it."""
if sys.platform == "win32":
    CONSOLE_SIGNALS += (signal.SIGBREAK,)
HANG_UP: tuple[signal.Signals, ...] = ()
"""Of a terminal that was closed; a console that is closed ends its processes on Windows."""
if sys.platform != "win32":
    HANG_UP = (signal.SIGHUP,)
STOP_SIGNALS = (signal.SIGTERM, *CONSOLE_SIGNALS)
"""They ask a program to stop in order."""

HAS_FILE_MODES = sys.platform != "win32"
_DENIED_FOR_S = 2.0
"""How long a file may be held by a virus scanner or a reader before it counts as denied."""
_FTDI = r"SYSTEM\CurrentControlSet\Enum\FTDIBUS"
_FORBIDDEN = re.compile(r'[<>:"/\\|?*\x00-\x1f]')
_RESERVED = re.compile(r"(con|prn|aux|nul|conin\$|conout\$|(com|lpt)[0-9¹²³]) *(\.|\Z)", re.IGNORECASE)


def lock_file(file: IO[Any]) -> None:
    """Lock an open, empty file until it is closed or its process ends. Raises OSError when it is locked."""
    if sys.platform == "win32":
        import msvcrt

        msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)
    else:
        import fcntl

        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)


def sync_file(file: IO[Any] | RawIOBase) -> None:
    """Bring an open file to the disk, so that a power cut leaves it whole. Raises OSError."""
    os.fsync(file.fileno())
    if sys.platform == "darwin":
        import fcntl

        with suppress(OSError):  # not every file system can
            fcntl.fcntl(file, fcntl.F_FULLFSYNC)


def move_over(source: Path, target: Path, *, durably: bool = False) -> None:
    """Rename ``source`` to ``target``, in place of what is there; ``durably``: on the disk when it returns.

    Raises OSError.
    """
    until = time.monotonic() + _DENIED_FOR_S
    while True:
        try:
            _move(source, target, durably)
            return
        except PermissionError:
            if sys.platform != "win32" or time.monotonic() > until:
                raise
            time.sleep(0.02)


def _move(source: Path, target: Path, durably: bool) -> None:
    if not durably:
        source.replace(target)
    elif sys.platform == "win32":
        import ctypes

        kernel, replace_existing, write_through = ctypes.WinDLL("kernel32", use_last_error=True), 1, 8
        if not kernel.MoveFileExW(str(source), str(target), replace_existing | write_through):
            raise ctypes.WinError(ctypes.get_last_error())
    else:
        source.replace(target)
        handle = os.open(target.parent, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)


def remove(path: Path) -> None:
    """Remove a file if it is there; on Windows one that somebody has open stays. Raises OSError."""
    try:
        path.unlink(missing_ok=True)
    except PermissionError:
        if sys.platform != "win32":
            raise


def boot() -> str:
    """What is the same for all programs of this computer until it starts again."""
    with suppress(OSError, subprocess.SubprocessError):
        if sys.platform == "linux":
            return Path("/proc/sys/kernel/random/boot_id").read_text(encoding="ascii")
        if sys.platform == "darwin":
            command = ["/usr/sbin/sysctl", "-n", "kern.bootsessionuuid"]
            return subprocess.run(command, capture_output=True, text=True, check=True, timeout=10).stdout
        if sys.platform == "win32":
            import winreg

            key = r"SYSTEM\CurrentControlSet\Control\Session Manager\Memory Management\PrefetchParameters"
            with winreg.OpenKey(winreg.HKEY_LOCAL_MACHINE, key) as opened:
                return f"{socket.gethostname()} {winreg.QueryValueEx(opened, 'BootId')[0]}"
    return f"{socket.gethostname()} {round((time.time() - time.monotonic()) / 60)}"


def held_back_ms(port: str) -> int:
    """How long the driver of an FTDI adapter at ``port`` keeps bytes back; 0 where that is not known."""
    if sys.platform == "win32":
        import winreg

        with suppress(OSError):
            with winreg.OpenKey(winreg.HKEY_LOCAL_MACHINE, _FTDI) as adapters:
                names = [winreg.EnumKey(adapters, n) for n in range(winreg.QueryInfoKey(adapters)[0])]
            for name in names:
                place = rf"{_FTDI}\{name}\0000\Device Parameters"
                with suppress(OSError), winreg.OpenKey(winreg.HKEY_LOCAL_MACHINE, place) as found:
                    if winreg.QueryValueEx(found, "PortName")[0].lower() == port.lower():
                        return int(winreg.QueryValueEx(found, "LatencyTimer")[0])
    return 0


def named_pipe(path: Path) -> FileIO:
    """Make a pipe that a program can open by its path to write to, and open its other end, before any writer
    has come. Raises OSError, also on Windows, whose pipes have no paths."""
    if sys.platform == "win32":
        raise OSError(errno.ENOSYS, "Windows has no pipes with paths")
    os.mkfifo(path, 0o600)
    end = os.open(path, os.O_RDONLY | os.O_NONBLOCK)  # does not wait for a writer
    os.set_blocking(end, True)
    return FileIO(end, "rb")


def listen_alone(opened: socket.socket) -> None:
    """Before ``bind``: no other program can listen there too, and a port just left is free again."""
    if sys.platform == "win32":
        opened.setsockopt(socket.SOL_SOCKET, socket.SO_EXCLUSIVEADDRUSE, 1)
    else:
        opened.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)


def name_for_a_file(name: str) -> str:
    """``name``, changed where the system could not give it to a file."""
    if sys.platform != "win32":
        return name
    name = _FORBIDDEN.sub("_", name).rstrip(". ") or "_"
    return f"_{name}" if _RESERVED.match(name) else name
