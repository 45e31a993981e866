"""Standard streams that cannot take what is printed. Closed ones: tests/service/cli/test_cli_pipes.py."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

PRINT = """
import sys
from glovecal_client.standard_streams import run_command

def command():
    print("60 \N{DEGREE SIGN} \N{FULL BLOCK}")
    print("60 \N{DEGREE SIGN} \N{FULL BLOCK}", file=sys.stderr)
    return 3

run_command(command)
"""


@pytest.mark.parametrize("unbuffered", ["", "1"])
def test_a_sign_that_the_encoding_lacks_ends_nothing(unbuffered: str) -> None:
    mine = os.environ | {"PYTHONIOENCODING": "latin-1", "PYTHONUNBUFFERED": unbuffered}
    done = subprocess.run([sys.executable, "-c", PRINT], env=mine, capture_output=True)
    assert done.returncode == 3
    assert done.stdout.decode("latin-1") == "60 ° ?\n"
    assert done.stderr.decode("latin-1") == "60 ° \\u2588\n"
