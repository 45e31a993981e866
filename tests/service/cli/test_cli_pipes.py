"""``glovecal ... | head``, ``2>&-``: no page is lost, no traceback left behind, exit codes as documented."""

from __future__ import annotations

import io
import json
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout, suppress
from functools import partial
from pathlib import Path
from typing import TextIO

import pytest
from cli_running import COMMAND, environment, glovecal
from small_session import write_sticky

from glovecal_service.cli.command import main
from glovecal_service.cli.terminal.printing import out

Settings = dict[str, str]


@pytest.fixture(autouse=True)
def nothing_is_left_to_print() -> Iterator[None]:
    """What a closed pipe did not take waits in the console, which here outlives the command."""
    yield
    out.begin_capture()
    out.end_capture()


@pytest.fixture(scope="module")
def trained(tmp_path_factory: pytest.TempPathFactory) -> tuple[Settings, str]:
    """Settings of a folder with a linear model of ``anna``, and the model's id."""
    folder = tmp_path_factory.mktemp("pipes")
    settings = {"GLOVECAL_DATA": str(folder / "data")}
    run = partial(glovecal, settings)
    assert run("take", "import", write_sticky(folder), "-s", "anna").code == 0
    options = ("--method", "linear", "--folds", "0", "--json")
    return settings, run("train", "-s", "anna", *options).json["result"]["model"]


@contextmanager
def unread_pipe() -> Iterator[TextIO]:
    """A real pipe whose reader is gone; each line goes into it at once, however large a Python's buffer."""
    reading, writing = os.pipe()
    os.close(reading)
    pipe = os.fdopen(writing, "w", 1)
    try:
        yield pipe
    finally:
        with suppress(BrokenPipeError):  # what is still buffered has no reader either
            pipe.close()


@pytest.mark.parametrize(
    "verb",
    [
        ("compare", "MODEL", "--take", "w1-t1"),
        ("where", "MODEL", "--take", "w1-t1", "--json"),
        ("diagnose", "MODEL"),
        ("improve", "-s", "anna", "--method", "linear", "--max-steps", "0"),
        ("take", "examine", "w1-t1", "--still", "w1-t1=I_PIP"),
    ],
    ids=lambda verb: verb[0],
)
def test_the_page_is_written_though_nobody_reads(
    trained: tuple[Settings, str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, verb: tuple[str, ...]
) -> None:
    settings, model = trained
    for name, value in settings.items():
        monkeypatch.setenv(name, value)
    monkeypatch.setattr(out, "quiet", False)  # which Rich makes True for good
    page = tmp_path / "page.html"
    arguments = [model if word == "MODEL" else word for word in verb]
    said = io.StringIO()
    with (
        unread_pipe() as pipe,
        redirect_stdout(pipe),
        redirect_stderr(said),
        pytest.raises(SystemExit) as end,
    ):
        main([*arguments, "--report", str(page)])
    assert (end.value.code, "Traceback" in said.getvalue()) == (1, False), said.getvalue()
    assert page.read_text().rstrip().endswith("</html>")


def test_sentences_that_nobody_reads_end_no_work(trained: tuple[Settings, str], tmp_path: Path) -> None:
    settings, _ = trained
    tables = [tmp_path / "one.csv", tmp_path / "two.csv"]
    for slope, table in enumerate(tables, 1):
        table.write_text("time_s,s.A,r.A\n" + "".join(f"{i / 10},{i * slope},{i}\n" for i in range(50)))
    command = [*COMMAND, "take", "import", *map(str, tables), "-s", "ben"]
    with unread_pipe() as pipe:
        done = subprocess.run(
            command, env=environment(settings), stdout=pipe, stderr=pipe, check=False, timeout=300
        )
    assert done.returncode == 1
    assert len(glovecal(settings, "take", "list", "-s", "ben", "--json").json) == 2


FORKS = """
import json, os, sys
from glovecal_client.capture.command import script as capture
from glovecal_service.cli.command import script as glovecal

def redirect(stream, to):
    number = {"stdout": 1, "stderr": 2}[stream]
    if to == "closed":
        setattr(sys, stream, None)
        os.close(number)
    elif to == "unread":
        reading, writing = os.pipe()
        os.close(reading)
        os.dup2(writing, number)
        os.close(writing)
    else:
        os.dup2(os.open(to, os.O_WRONLY), number)

for arguments, streams in json.load(sys.stdin):
    child = os.fork()
    if child == 0:
        for stream, to in streams.items():
            redirect(stream, to)
        sys.argv = arguments
        capture() if arguments[0] == "glovecal-capture" else glovecal()
    print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), flush=True)
"""
"""Commands in children of one process, which has imported all; each child ends as any Python does."""

ANSWERS = (["glovecal", "--version"], ["glovecal", "take", "--help"], ["glovecal-capture", "--help"])
COMPLAINTS = (
    (["glovecal", "take", "--nonsense"], 2),
    (["glovecal", "emulate", "nothing"], 1),
    (["glovecal-capture", "--device", "replay:/nowhere.csv", "--glove", "g1"], 1),
)
ENDINGS = [
    *((verb, {"stdout": to}, 1) for verb in ANSWERS for to in ("unread", "/dev/full")),
    *((verb, {"stdout": "closed", "stderr": "closed"}, 0) for verb in ANSWERS),
    *((verb, {"stderr": to}, code) for verb, code in COMPLAINTS for to in ("unread", "closed")),
]


def test_exit_codes_are_the_documented_ones_wherever_the_streams_lead(tmp_path: Path) -> None:
    mine = environment({"GLOVECAL_DATA": str(tmp_path)})
    cases = json.dumps([(verb, streams) for verb, streams, _ in ENDINGS])
    done = subprocess.run(
        [sys.executable, "-c", FORKS], env=mine, input=cases, capture_output=True, text=True, timeout=300
    )
    codes = [int(line) for line in done.stdout.splitlines() if line.isdecimal()]
    assert list(zip(ENDINGS, codes, strict=True)) == [(ending, ending[2]) for ending in ENDINGS], done.stderr
    assert "Traceback" not in done.stderr
    assert "Standard output cannot be written: No space left on device." in done.stderr
