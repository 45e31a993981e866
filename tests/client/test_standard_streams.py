"""Standard streams that cannot take what is printed. Closed ones: tests/service/cli/test_cli_pipes.py."""

from __future__ import annotations

import os
import re
import subprocess
import sys

import pytest

PRINT = """
import sys
from glovecal_client.program import run_command

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


LINES = 5000
UNREAD = f"""
import sys
from glovecal_client.program import never_wait, run_command

def command():
    never_wait()
    for number in range({LINES}):
        print(f"line {{number:05d}} {{'.' * 80}}", file=sys.stderr)
    print("done", flush=True)
    sys.stdin.readline()
    print("line last", file=sys.stderr)

run_command(command)
"""


def unread() -> subprocess.Popen[str]:
    pipe = subprocess.PIPE
    return subprocess.Popen([sys.executable, "-c", UNREAD], stdin=pipe, stdout=pipe, stderr=pipe, text=True)


def test_a_process_goes_on_though_nobody_reads_what_it_complains_of() -> None:
    process = unread()
    assert process.stdout is not None
    assert process.stdout.readline() == "done\n"
    _, complaints = process.communicate("go on\n", timeout=60)
    lines = complaints.splitlines()
    assert process.returncode == 0
    assert lines[0].startswith("line 00000 ")
    left_out = re.findall(r"^\((\d+) lines were left out here", complaints, re.MULTILINE)
    assert sum(line.startswith("line ") for line in lines) + sum(map(int, left_out)) == LINES + 1


def test_it_ends_though_nobody_reads() -> None:
    process = unread()
    assert process.stdin is not None
    process.stdin.write("go on\n")
    process.stdin.flush()
    assert process.wait(timeout=60) == 0
    process.communicate()
