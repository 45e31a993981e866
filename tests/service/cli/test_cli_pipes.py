"""``glovecal ... | head``: whoever stops reading loses no page, and no traceback is left behind."""

from __future__ import annotations

import io
import os
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout
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
    """A real pipe whose reader is gone."""
    reading, writing = os.pipe()
    os.close(reading)
    with os.fdopen(writing, "w") as pipe:
        yield pipe


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
