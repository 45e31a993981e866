"""What tests, and the processes they start, see of their user's settings: nothing.

tests/verbs tries ``do.py test --smoke`` with a user who has set everything otherwise, and this file in it.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys

PROGRAM = """
import json, os, signal, sys, time
umask = os.umask(0)
print(json.dumps({
    "variables": sorted(name for name in os.environ if not name.startswith("PYTEST_")),
    "Ctrl-C interrupts": signal.getsignal(signal.SIGINT) is signal.default_int_handler,
    "utf-8": "\N{DEGREE SIGN}".encode(sys.getfilesystemencoding()) == b"\\xc2\\xb0",
    "umask": umask,
    "hours": time.strftime("%z"),
}))
"""
LEFT = {"PATH", "HOME", "TMPDIR", "LD_LIBRARY_PATH"}
OF_LIBRARIES = {"COLUMNS", "LINES", "LC_CTYPE"}
"""Set by readline, which pytest loads, and by Python where there is no locale."""
THREADS = {"OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"}
OF_TESTS = {
    f"GLOVECAL_{name}" for name in ("REQUIRE_EVERYTHING", "CAPTURE_MINUTES", "PICTURES", "SCREENSHOTS")
}


def test_nothing_that_a_user_has_set_reaches_a_test() -> None:
    done = subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, text=True, check=True)
    seen = json.loads(done.stdout)
    variables = set(seen.pop("variables"))
    assert variables - LEFT - OF_TESTS - OF_LIBRARIES == THREADS | {"TZ"}
    assert seen == {"Ctrl-C interrupts": True, "utf-8": True, "umask": 0o022, "hours": "+0545"}
    assert os.environ["HOME"].endswith("home")
