"""``do.py`` where its Python is another, or pip or the network is missing: one sentence, and no traceback."""

from __future__ import annotations

import shutil
import subprocess
import sys
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from typing import NoReturn

import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    """Nothing is installed in it yet."""
    for name in ("do.py", "pyproject.toml"):
        shutil.copyfile(ROOT / name, tmp_path / name)
    return tmp_path


def said(checkout: Path) -> list[str]:
    """What a verb that cannot run tells, line by line."""
    command = [sys.executable, str(checkout / "do.py"), "glovecal", "effects"]
    environment = {
        "PATH": "/nowhere",
        "HOME": str(checkout),
        "UV_OFFLINE": "1",
        "PIP_NO_INDEX": "1",
    }
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stdout) == (2, "")
    return done.stderr.splitlines()


def test_a_computer_without_a_fitting_python_gets_one_sentence(
    checkout: Path, not_here: Callable[[str], NoReturn]
) -> None:
    if not (ROOT / ".tools" / "uv").is_dir():
        not_here("needs the uv that do.py installs: python3 do.py test")
    for part in ("uv", "bin"):
        (checkout / ".tools").mkdir(exist_ok=True)
        (checkout / ".tools" / part).symlink_to(ROOT / ".tools" / part)
    assert said(checkout) == [
        "no Python 3.11 to 3.14 is here: bringing 3.13 into .tools ...",
        f"Glovecal needs Python 3.11 to 3.14; here is {sys.version.split()[0]}, and uv could not bring one: "
        "install one of them and try again",
    ]


def test_a_python_without_pip_is_told_how_to_get_it(
    checkout: Path, not_here: Callable[[str], NoReturn]
) -> None:
    """The environment's own has none, as Debian's has none without python3-pip."""
    if find_spec("pip") is not None:
        not_here("needs a Python without pip, as in the environment that do.py makes")
    *_, last = said(checkout)
    assert last.endswith("has no pip: install it (Debian, Ubuntu: apt install python3-pip)")
