"""What tests, and the processes they start, see of their user's settings: nothing.

tests/verbs tries ``do.py test --smoke`` with a user who has set everything otherwise, and this file in it.
"""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PROGRAM = """
import json, os, signal, sys, time
umask = os.umask(0)
print(json.dumps({
    "variables": sorted(name for name in os.environ if not name.startswith("PYTEST_")),
    "Ctrl-C interrupts": signal.getsignal(signal.SIGINT) is signal.default_int_handler,
    "utf-8": "\N{DEGREE SIGN}".encode(sys.getfilesystemencoding()) == b"\\xc2\\xb0",
    "umask": umask,
    "threads": os.environ.get("OMP_NUM_THREADS"),
    "hours": time.strftime("%z"),
}))
"""
OF_TESTS = {
    f"GLOVECAL_{name}" for name in ("REQUIRE_EVERYTHING", "CAPTURE_MINUTES", "PICTURES", "SCREENSHOTS")
}
OF_A_USER = ("GLOVECAL_", "PYTHON", "LANG", "LC_", "XDG_", "MPL", "DASK", "HTTP", "DISPLAY", "ANYTHING_ELSE")
BY_PYTHON = {"LC_CTYPE"}
"""Where there is no locale."""
BY_DASK = {"PYTHONHASHSEED"}
"""Dask sets it in a process that has started workers, which an earlier test may have done."""


def test_nothing_that_a_user_has_set_reaches_a_test() -> None:
    done = subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, text=True, check=True)
    seen = json.loads(done.stdout)
    variables = set(seen.pop("variables"))
    assert not {name for name in variables - OF_TESTS - BY_PYTHON - BY_DASK if name.startswith(OF_A_USER)}
    assert seen == {
        "Ctrl-C interrupts": True,
        "utf-8": True,
        "umask": 0o022,
        "hours": "+0545",
        "threads": "1",
    }
    assert Path.home().is_relative_to(ROOT)
