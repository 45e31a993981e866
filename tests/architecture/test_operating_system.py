"""What differs between Linux, macOS and Windows is named in one module a part; nothing else does."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
MODELS, CLIENT = ("models/glovecal_models", "models/glovecal"), ("client/glovecal_client", "client/examples")
PARTS = (*MODELS, *CLIENT, "service/glovecal_service", "service/glovecal_command")
FILES = sorted(path for part in PARTS for path in (ROOT / part).rglob("*.py"))
THE_MODULES = {
    "client/glovecal_client/operating_system.py",
    "client/glovecal_client/clock.py",
    "service/glovecal_service/operating_system.py",
    "service/glovecal_service/emulators/pseudo_terminal.py",
}
SYSTEMS_OWN = {
    "_winapi", "_winreg", "ctypes", "fcntl", "grp", "msvcrt", "nt", "platform", "posix", "pty", "pwd",
    "readline", "resource", "syslog", "termios", "tty", "winreg",
}  # fmt: skip
NAMES = {
    "os": {
        "chown", "fchmod", "fork", "fsync", "getgid", "getloadavg", "getpgid", "getppid", "getuid",
        "geteuid", "kill", "killpg", "mkfifo", "name", "nice", "O_DIRECTORY", "O_NOFOLLOW", "O_NONBLOCK",
        "openpty", "pipe", "posix_fallocate", "PRIO_PROCESS", "rename", "replace", "sched_getaffinity",
        "sched_setaffinity", "set_blocking", "setpgid", "setpriority", "setsid", "statvfs", "sync", "sysconf",
        "ttyname", "uname", "wait", "waitpid",
    },
    "sys": {"platform", "getwindowsversion"},
    "time": {"monotonic_ns", "time_ns", "clock_gettime", "clock_gettime_ns", "tzset"},
    "signal": {
        "SIGALRM", "SIGBREAK", "SIGCHLD", "SIGCONT", "SIGHUP", "SIGKILL", "SIGPIPE", "SIGQUIT", "SIGSTOP",
        "SIGUSR1", "SIGUSR2", "CTRL_BREAK_EVENT", "CTRL_C_EVENT", "alarm", "pause", "pthread_kill",
        "pthread_sigmask", "setitimer",
    },
    "socket": {"AF_UNIX", "SO_EXCLUSIVEADDRUSE", "SO_REUSEADDR", "SO_REUSEPORT"},
    "select": {"poll", "epoll", "kqueue"},
    "subprocess": {"CREATE_NEW_PROCESS_GROUP", "STARTUPINFO"},
    "multiprocessing": {"set_start_method"},
    "tempfile": {"NamedTemporaryFile", "mkstemp"},
}  # fmt: skip
"""On Windows missing, or something else: ``os.replace`` of an open file is denied, a temporary file with a
name cannot be opened a second time, ``time.monotonic_ns`` goes on every 15.6 ms."""
CALLS = {"terminate", "send_signal", "setitimer", "add_signal_handler", "set_blocking"}
"""Methods that end a process of ours: on Windows at once."""
SYSTEM_PATHS = ("/proc/", "/sys/", "/etc/", "/dev/shm", "/dev/null", "/tmp/", "/var/", "/usr/")
ALLOWED = {
    # files that systemd reads: Linux's by name
    ("client/glovecal_client/capture/command.py", "/var/"),
    # one file in two distributions: how a command is written for the shell of its user
    ("client/glovecal_client/installation.py", "os.name"),
    ("models/glovecal_models/installation.py", "os.name"),
    # the one place of the mathematics that starts processes: they are in a group of their own
    ("models/glovecal_models/worker_processes.py", "getattr(subprocess, ...)"),
}
MODELS_OWN_FILES = ("models/",)
"""They write files for who calls them, in its process: a file it holds open itself is told by its error."""


def named(path: Path) -> set[str]:
    """``module.name`` for every attribute and import, ``.name()`` for calls, and strings that are paths."""
    tree, found, modules = ast.parse(path.read_text(encoding="utf-8")), set(), {}
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            for alias in node.names:
                modules[alias.asname or alias.name.split(".")[0]] = alias.name
                found.add(alias.name.split(".")[0])
        elif isinstance(node, ast.ImportFrom) and node.module and node.level == 0:
            found.add(node.module.split(".")[0])
            found |= {f"{node.module}.{alias.name}" for alias in node.names}
    documentation = {id(text) for text in _documentation(tree)}
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            found.add(f"{modules.get(node.value.id, node.value.id)}.{node.attr}")
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
            found.add(f".{node.func.attr}()")
            is_text = [isinstance(each, ast.Constant | ast.JoinedStr) for each in node.args]
            if node.func.attr in ("rename", "replace") and is_text == [False] and not node.keywords:
                found.add("a file is replaced")
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
            module = node.args[0].id if node.args and isinstance(node.args[0], ast.Name) else ""
            if node.func.id in ("hasattr", "getattr") and module in NAMES:
                found.add(f"{node.func.id}({module}, ...)")
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in documentation:
            found |= {folder for folder in SYSTEM_PATHS if folder in node.value}
    return found


def _documentation(tree: ast.AST) -> list[ast.AST]:
    return [node.value for node in ast.walk(tree) if isinstance(node, ast.Expr)]


FORBIDDEN = (
    SYSTEMS_OWN
    | {f"{module}.{name}" for module, names in NAMES.items() for name in names}
    | {f".{name}()" for name in CALLS}
    | {f"{ask}({module}, ...)" for ask in ("hasattr", "getattr") for module in NAMES}
    | set(SYSTEM_PATHS)
    | {"a file is replaced"}
)


@pytest.mark.parametrize("part", PARTS)
def test_only_the_modules_of_the_operating_system_name_it(part: str) -> None:
    wrong = {}
    for path in FILES:
        place = path.relative_to(ROOT).as_posix()
        if not place.startswith(f"{part}/") or place in THE_MODULES:
            continue
        found = {name for name in named(path) & FORBIDDEN if (place, name) not in ALLOWED}
        if place.startswith(MODELS_OWN_FILES):
            found -= {"os.replace", "a file is replaced"}
        if found:
            wrong[place] = sorted(found)
    assert not wrong, "ask glovecal_client.operating_system, its clock, or glovecal_service.operating_system"


@pytest.mark.parametrize("place", sorted(THE_MODULES))
def test_each_of_them_is_needed(place: str) -> None:
    assert named(ROOT / place) & FORBIDDEN


@pytest.mark.parametrize(
    "code",
    [
        "import os\nos.statvfs('.')",
        "import os as system\nsystem.setpriority(0, 0, 1)",
        "import sys\nif sys.platform == 'linux': ...",
        "from termios import tcgetattr",
        "import os\nif hasattr(os, 'nice'): ...",
        "from time import monotonic_ns",
        "process.terminate()",
        "part.replace(path)",
        "open('/proc/cpuinfo')",
    ],
)
def test_what_would_be_found(tmp_path: Path, code: str) -> None:
    file = tmp_path / "code.py"
    file.write_text(code)
    assert named(file) & FORBIDDEN
