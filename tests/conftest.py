"""What tests need beside the repository: without it they skip with a sentence, or fail where CI has it.

And what they must not see: how this computer and the shell that began them are set up.
"""

from __future__ import annotations

import gc
import inspect
import logging
import os
import re
import shutil
import signal
import subprocess
import sys
import sysconfig
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Any, NoReturn

import httpx
import httpx._transports.default as _transport
import hypothesis
import pytest

# the same examples in every run; how long one takes depends on what else the computer does
hypothesis.settings.register_profile(
    "same everywhere",
    derandomize=True,
    deadline=None,
    database=None,
    suppress_health_check=[hypothesis.HealthCheck.too_slow],
)
hypothesis.settings.load_profile("same everywhere")

for _part in ("connect", "read", "write", "pool"):
    # a test's request waits for its answer as pages do: five seconds are too few on a busy computer
    setattr(inspect.signature(httpx.Client).parameters["timeout"].default, _part, 120.0)

# tests ask thousands of times, and reading this computer's certificates takes longer than most answers
_of_httpx = _transport.__dict__
_of_httpx["create_ssl_context"] = cache(_of_httpx["create_ssl_context"])

SHARED_DATA = Path(__file__).resolve().parents[2] / "shared" / "data"
REQUIRE_EVERYTHING = "GLOVECAL_REQUIRE_EVERYTHING"
OF_TESTS = (REQUIRE_EVERYTHING, "GLOVECAL_CAPTURE_MINUTES", "GLOVECAL_PICTURES", "GLOVECAL_SCREENSHOTS")
OF_WINDOWS = ("SYSTEMROOT", "SYSTEMDRIVE", "WINDIR", "COMSPEC", "PATHEXT", "TEMP", "TMP", "USERPROFILE")
KEPT = ("PATH", "LD_LIBRARY_PATH", "TMPDIR", *OF_WINDOWS, *OF_TESTS)
KEPT_BEGINNINGS = ("PYTEST_",)
SET = {
    "TZ": "NPT-5:45",  # an hour of no computer, so that local time and UTC are never mixed up unseen
    "OMP_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
    "MKL_NUM_THREADS": "1",
}
HOME = Path(__file__).resolve().parents[1] / ".pytest_cache" / "home"
"""Kept, for caches of fonts and compiled code; what a user keeps at home is not seen."""
MASK = 0o022
OURS = {"tests", "docs", "pytest", "_pytest"}
"""pytest warns of what tests leave behind."""
COMPILERS = {
    ".cpp": (("c++", "g++", "clang++"), ("-std=c++17", "-Wall", "-Wextra", "-Werror"), "g++"),
    ".rs": (("rustc",), ("--edition", "2021", "-D", "warnings"), "rustc"),
}
"""Of a source, by its ending: commands, options, Debian's package."""
OUTSIDE = pytest.StashKey[dict[str, str]]()


def pytest_configure(config: pytest.Config) -> None:
    """Before any test is imported and any worker process started; in each of these too."""
    config.stash[OUTSIDE] = getattr(config, "workerinput", {}).get("outside") or dict(os.environ)
    kept = {
        name: value for name, value in os.environ.items() if name in KEPT or name.startswith(KEPT_BEGINNINGS)
    }
    os.environ.clear()
    HOME.mkdir(parents=True, exist_ok=True)
    os.environ.update(kept | SET | {"HOME": str(HOME)})
    if hasattr(time, "tzset"):
        time.tzset()
    signal.signal(signal.SIGINT, signal.default_int_handler)  # ignored in a script's background jobs
    if hasattr(signal, "SIGHUP"):
        signal.signal(signal.SIGHUP, signal.SIG_DFL)  # ignored after nohup
    os.umask(MASK)
    _tell_warnings_of_others(config)


@pytest.hookimpl(optionalhook=True)
def pytest_configure_node(node: Any) -> None:
    """Of pytest-xdist: what its worker processes are told."""
    node.workerinput["outside"] = node.config.stash[OUTSIDE]


@pytest.fixture(scope="session")
def outside(request: pytest.FixtureRequest) -> Mapping[str, str]:
    """The environment that the tests were begun in, with caches, proxies and certificates of installers."""
    return request.config.stash[OUTSIDE]


COMPUTING = ("models", "paper", "study", "architecture")
TOGETHER = ("tests/models/colour_glove/", "tests/service/studio/", "tests/models/library/")
"""Folders whose files share something that is made once in a process, and slowly: compiled kernels and a
database of poses, a service with a browser, a trained model."""
LONG = {
    "tests/service/site/test_remote_workers.py", "tests/models/improvement/test_second_names.py",
    "tests/service/test_sampling_service.py", "tests/service/test_serve_processes.py",
    "tests/docs/test_docs_printed.py", "tests/windows_like/test_windows_like.py",
    "tests/service/cli/test_cli_trigger.py", "tests/service/test_encrypted_data_folder.py",
    "tests/service/cli/test_cli_live.py", "tests/service/test_secret_files.py",
    "tests/docs/test_docs_site.py", "tests/models/calibration/test_kernel_choice.py",
}  # fmt: skip
"""Files of a minute and more: the last files to be begun are short, so that all processes end together."""


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """Each worker process takes a file at a time, or one of the folders of ``TOGETHER``."""
    from xdist.scheduler import LoadFileScheduling

    class LoadFileOrFolder(LoadFileScheduling):
        def _split_scope(self, nodeid: str) -> str:
            folder = next((each for each in TOGETHER if nodeid.startswith(each)), None)
            return folder or super()._split_scope(nodeid)

    return LoadFileOrFolder(config, log) if config.getoption("dist") == "loadfile" else None


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Files that compute come between files that wait for gloves, cables and pages: both at once. Folders
    that one process runs as a whole come first, then long files: nobody waits for the last of them."""
    files: dict[Path, list[pytest.Item]] = {}
    for item in items:
        files.setdefault(item.path, []).append(item)
    here = Path(__file__).parent
    assert all((here.parent / name).is_file() for name in LONG), "no such file: write LONG anew"
    kinds: dict[bool, list[Path]] = {True: [], False: []}
    place: dict[Path, float] = {}
    for path in files:
        within = path.relative_to(here.parent).as_posix()
        if within.startswith(TOGETHER):
            place[path] = -1.0
        else:
            kinds[within.split("/")[1] in COMPUTING].append(path)
    for paths in kinds.values():
        paths.sort(key=lambda path: path.relative_to(here.parent).as_posix() not in LONG)
        place |= {path: (number + 0.5) / len(paths) for number, path in enumerate(paths)}
    items[:] = [item for path in sorted(files, key=place.__getitem__) for item in files[path]]


def pytest_collection_finish() -> None:
    """What was imported until now stays: the garbage collector looked through it again and again."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(20_000, 20, 20)


def _tell_warnings_of_others(config: pytest.Config) -> None:
    """A warning in our lines is an error; one in the lines of what is installed is told and fails nothing.

    What was not closed is noticed anywhere: that stays an error.
    """
    installed = {path.name.partition(".")[0] for path in Path(sysconfig.get_path("purelib")).iterdir()}
    names = "|".join(re.escape(name) for name in installed if name.isidentifier() and name not in OURS)
    theirs = rf"({names})(\.|\Z)|.*[\\/]site-packages[\\/]"  # by its path where it is being compiled
    config.addinivalue_line("filterwarnings", f"default:::{theirs}")
    config.addinivalue_line("filterwarnings", "error::ResourceWarning")


@pytest.fixture(autouse=True)
def process_as_it_was() -> Iterator[None]:
    """A command sets its process's umask and where it logs to; here many commands and tests share a process.

    The handler of a ``serve`` that a test had refused wrote tracebacks into what later commands said.
    """
    root = logging.getLogger()
    _reset_process()
    level, hooks = root.level, (sys.excepthook, threading.excepthook)
    yield
    _reset_process()
    root.handlers[:] = [each for each in root.handlers if type(each) is not logging.StreamHandler]
    root.setLevel(level)
    sys.excepthook, threading.excepthook = hooks


def _reset_process() -> None:
    os.umask(MASK)


def pytest_runtest_setup(item: pytest.Item) -> None:
    if item.get_closest_marker("needs_shared_data") is not None and not SHARED_DATA.is_dir():
        missing("needs the real recordings, which are not part of the repository")


@pytest.fixture(scope="session")
def not_here() -> Callable[[str], NoReturn]:
    """Call it with a sentence when what a test needs is not on this computer."""
    return missing


def missing(sentence: str) -> NoReturn:
    """Skip; in CI, where everything must be there, fail."""
    if os.environ.get(REQUIRE_EVERYTHING) == "1":
        pytest.fail(sentence)
    pytest.skip(sentence)


@pytest.fixture(scope="session")
def compiled(tmp_path_factory: pytest.TempPathFactory, outside: Mapping[str, str]) -> Callable[[Path], Path]:
    """The program of a source in another language; where no compiler of it runs, what ``missing`` does."""

    def program(source: Path) -> Path:
        commands, options, package = COMPILERS[source.suffix]
        found = (path for path in map(shutil.which, commands) if path)
        compiler = next((path for path in found if _runs(path, outside)), None)
        if compiler is None:
            missing(f"no compiler of {source.name} runs here (Debian: apt-get install {package})")
        made = tmp_path_factory.mktemp("compiled") / source.name.replace(".", "-")
        subprocess.run([compiler, *options, "-o", str(made), str(source)], check=True, env=dict(outside))
        return made

    return program


def _runs(compiler: str, environment: Mapping[str, str]) -> bool:
    """What rustup puts on the path does nothing without a toolchain in the user's home."""
    return subprocess.run([compiler, "--version"], capture_output=True, env=dict(environment)).returncode == 0
