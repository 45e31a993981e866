"""Linux with what Windows lacks taken away, for Glovecal's own modules: with this folder in PYTHONPATH.

Modules of Glovecal get builtins of their own, whose ``import`` gives them another ``os``, ``sys``, ``time``
and so on: names that Windows has not are missing there, what behaves otherwise does so. Third-party packages
see Linux. Within the folder WINDOWS_LIKE_FOLDER, for everybody, an open file can be neither replaced nor
removed.

It shows what cannot work on Windows. That something works there it does not prove.
"""

from __future__ import annotations

import builtins
import ctypes
import errno
import importlib.machinery
import multiprocessing.popen_fork
import os
import select
import signal
import socket
import stat
import subprocess
import sys
import time
import types
from pathlib import Path
from typing import Any

FOLDER = os.environ.get("WINDOWS_LIKE_FOLDER", "")
PROCESSES = Path(FOLDER, "windows-like-processes")
TICK_NS = 15_625_000
SIGBREAK = signal.SIGUSR1
"""Stands for it: nothing else sends it."""
CTRL_BREAK_EVENT, CREATE_NEW_PROCESS_GROUP = 1, 0x200
NOT_THERE = {
    "os": """chown fchmod fchown fork forkpty geteuid getgid getloadavg getpgid getpriority getuid killpg
        lchown mkfifo nice openpty pipe2 posix_fallocate posix_spawn pread pwrite sched_getaffinity
        sched_setaffinity setpgid setpriority setsid statvfs fstatvfs sysconf ttyname uname
        O_DIRECTORY O_NOFOLLOW O_NONBLOCK PRIO_PROCESS WNOHANG fdatasync sync""",
    "signal": """SIGALRM SIGCHLD SIGCONT SIGHUP SIGKILL SIGPIPE SIGQUIT SIGSTOP SIGTSTP SIGUSR1 SIGUSR2
        alarm pause pthread_kill pthread_sigmask setitimer sigwait""",
    "select": "poll epoll",
    "socket": "AF_UNIX SO_REUSEPORT",
    "time": "clock_gettime clock_gettime_ns tzset",
}
NO_MODULES = {"fcntl", "grp", "posix", "pty", "pwd", "resource", "syslog", "termios", "tty"}


class Other(types.ModuleType):
    """A module as Windows has it: what is not told here is asked of the real one, and set there."""

    def __init__(self, real: types.ModuleType, **changed: object) -> None:
        super().__init__(real.__name__)
        missing = set(NOT_THERE.get(real.__name__, "").split())
        self.__dict__.update(_real=real, _changed=changed, _missing=missing)

    def __getattr__(self, name: str) -> Any:
        if name in self._missing:
            raise AttributeError(f"module {self._real.__name__!r} has no attribute {name!r} on Windows")
        return self._changed[name] if name in self._changed else getattr(self._real, name)

    def __setattr__(self, name: str, value: object) -> None:
        setattr(self._real, name, value)


def note(sentence: str) -> None:
    with open(Path(FOLDER, "windows-like.log"), "a", encoding="utf-8") as log:
        log.write(f"{sentence}\n")


def denied(path: object, why: str) -> PermissionError:
    note(f"{why}: {path}")
    return PermissionError(errno.EACCES, f"denied on Windows ({why})", str(path))


def is_open(path: object) -> bool:
    """Whether a process under this shim has it open or mapped."""
    try:
        wanted = os.stat(path, follow_symlinks=False)  # type: ignore[arg-type]
    except OSError:
        return False
    if not stat.S_ISREG(wanted.st_mode):
        return False
    for entry in os.listdir(PROCESSES):
        try:
            for handle in os.listdir(f"/proc/{entry}/fd"):
                there = os.stat(f"/proc/{entry}/fd/{handle}")
                if (there.st_dev, there.st_ino) == (wanted.st_dev, wanted.st_ino):
                    return True
            if os.fsencode(os.path.abspath(path)) in Path(f"/proc/{entry}/maps").read_bytes():  # type: ignore[type-var]
                return True
        except OSError:  # it ended
            continue
    return False


def refuse_open(*paths: object) -> None:
    for path in paths:
        if isinstance(path, str | os.PathLike) and is_watched(os.path.abspath(path)) and is_open(path):
            raise denied(path, "a process has it open")


def is_watched(path: str) -> bool:
    return path.startswith(FOLDER) and "/fits/workers/" not in path  # there Dask keeps house


def guarded(real, paths: int):
    def call(*arguments, **options):
        if not options.get("dir_fd"):
            refuse_open(*arguments[:paths])
        return real(*arguments, **options)

    return call


def open_file(path, flags, *rest, **options):
    if isinstance(path, str | bytes | os.PathLike) and os.path.isdir(path):
        raise denied(path, "a folder is opened")
    return os.open(path, flags, *rest, **options)


def rename(source, target):
    if os.path.exists(target):
        raise FileExistsError(errno.EEXIST, "exists already, on Windows", str(target))
    os.rename(source, target)


def kill(process: int, number: int) -> None:
    os.kill(process, signal.SIGKILL)  # TerminateProcess, whatever the number


class Popen(subprocess.Popen):
    def __init__(self, *arguments, creationflags: int = 0, start_new_session: bool = False, **options):
        group = {"process_group": 0} if creationflags & CREATE_NEW_PROCESS_GROUP else {}
        super().__init__(*arguments, **options, **group)

    def kill(self) -> None:
        if self.poll() is None:
            note(f"killed: {self.args}")
        super().kill()

    def terminate(self) -> None:
        self.kill()

    def send_signal(self, sig: int) -> None:
        if sig == CTRL_BREAK_EVENT and self.poll() is None:
            os.killpg(self.pid, SIGBREAK)
        elif sig != CTRL_BREAK_EVENT:
            super().send_signal(sig)


def set_signal(number, handler):
    if number not in (signal.SIGINT, signal.SIGTERM, SIGBREAK):
        raise ValueError("invalid signal value on Windows")
    return signal.signal(number, handler)


def wait_for_sockets(*handles_and_limit):
    for handle in (each for group in handles_and_limit[:3] for each in group):
        number = handle if isinstance(handle, int) else handle.fileno()
        if not stat.S_ISSOCK(os.fstat(number).st_mode):
            raise OSError(10038, "on Windows select takes sockets only")
    return select.select(*handles_and_limit)


class Kernel32:
    def __init__(self, *_, **__) -> None: ...

    def __getattr__(self, name: str) -> object:
        if name in ("GetCurrentProcess", "GetCurrentThread", "SetPriorityClass", "SetThreadPriority"):
            return lambda *_: 1
        raise AttributeError(name)

    def MoveFileExW(self, source: str, target: str, flags: int) -> int:  # noqa: N802
        assert flags & 1
        try:
            os.replace(source, target)
        except OSError as error:
            ctypes.set_errno(error.errno or 0)
            return 0
        return 1

    def GetSystemTimePreciseAsFileTime(self, place) -> None:  # noqa: N802
        place._obj.value = time.time_ns() // 100 + 116_444_736_000_000_000


def locking(handle: int, mode: int, size: int) -> None:
    import fcntl

    fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)  # raises as msvcrt does where it is locked


KEYS = list(os.environ.get("WINDOWS_LIKE_KEYS", ""))


class RegistryKey:
    def __enter__(self):
        return self

    def __exit__(self, *_):
        return None


def module(name: str, **content: object) -> types.ModuleType:
    made = types.ModuleType(name)
    made.__dict__.update(content)
    return made


OTHERS = {
    "os": Other(os, name="nt", open=open_file, rename=rename, kill=kill),
    "sys": Other(sys, platform="win32"),
    "signal": Other(signal, signal=set_signal, SIGBREAK=SIGBREAK, CTRL_BREAK_EVENT=CTRL_BREAK_EVENT),
    "subprocess": Other(subprocess, Popen=Popen, CREATE_NEW_PROCESS_GROUP=CREATE_NEW_PROCESS_GROUP),
    "select": Other(select, select=wait_for_sockets),
    "socket": Other(socket, SO_EXCLUSIVEADDRUSE=socket.SO_REUSEADDR),
    "ctypes": Other(
        ctypes,
        WinDLL=Kernel32,
        get_last_error=ctypes.get_errno,
        WinError=lambda number: OSError(number, "as Windows says it"),
    ),
    "time": Other(
        time,
        monotonic=lambda: (time.monotonic_ns() // TICK_NS * TICK_NS) / 1e9 + 1000,
        monotonic_ns=lambda: time.monotonic_ns() // TICK_NS * TICK_NS + 10**12,
        time=lambda: (time.time_ns() // TICK_NS * TICK_NS) / 1e9,
        time_ns=lambda: time.time_ns() // TICK_NS * TICK_NS,
    ),
    "msvcrt": module(
        "msvcrt", locking=locking, LK_NBLCK=2, kbhit=lambda: bool(KEYS), getwch=lambda: KEYS.pop(0)
    ),
    "winreg": module(
        "winreg",
        HKEY_LOCAL_MACHINE=1,
        OpenKey=lambda *_: RegistryKey(),
        QueryValueEx=lambda *_: (Path("/proc/sys/kernel/random/boot_id").read_text(), 4),
    ),
}


def import_(name, globals=None, locals=None, fromlist=(), level=0):
    top = name.split(".")[0]
    if level == 0 and top in NO_MODULES:
        raise ModuleNotFoundError(f"No module named {name!r} on Windows", name=name)
    found = (
        None if top in ("msvcrt", "winreg") else builtins.__import__(name, globals, locals, fromlist, level)
    )
    return OTHERS[top] if level == 0 and top in OTHERS and (name == top or not fromlist) else found


BUILTINS = {**vars(builtins), "__import__": import_}


class Loader(importlib.machinery.SourceFileLoader):
    def exec_module(self, module: types.ModuleType) -> None:
        module.__dict__["__builtins__"] = BUILTINS
        super().exec_module(module)


class Finder:
    @staticmethod
    def find_spec(name, path=None, target=None):
        if not name.split(".")[0].startswith("glovecal"):
            return None
        spec = importlib.machinery.PathFinder.find_spec(name, path, target)
        if spec is not None and type(spec.loader) is importlib.machinery.SourceFileLoader:
            spec.loader = Loader(spec.loader.name, spec.loader.path)
        return spec


if FOLDER:
    PROCESSES.mkdir(exist_ok=True)
    Path(PROCESSES, str(os.getpid())).touch()
    os.replace = guarded(os.replace, 2)
    os.rename = guarded(os.rename, 2)
    os.unlink = os.remove = guarded(os.unlink, 1)
    multiprocessing.popen_fork.Popen.terminate = multiprocessing.popen_fork.Popen.kill
    sys.meta_path.insert(0, Finder)  # type: ignore[arg-type]
