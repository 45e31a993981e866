"""Runs the ``glovecal`` command for tests: in this process, or as a process of its own."""

from __future__ import annotations

import io
import json
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from dataclasses import dataclass
from typing import Any

from told_commands import complaint, with_samples

from glovecal_models.simulation.protocol import segments
from glovecal_models.simulation.simulated_glove import SimulatedGlove, simulate_take
from glovecal_models.takes.take import Take
from glovecal_service.cli.command import main

COMMAND = [sys.executable, "-m", "glovecal_service.cli.command"]


@dataclass(frozen=True)
class Answer:
    """What a verb said and how it ended."""

    code: int
    out: str
    err: str

    @property
    def json(self) -> Any:
        """Standard output as one JSON document: fails when anything else is on it."""
        assert self.code == 0, self.err
        return json.loads(self.out)

    @property
    def said(self) -> str:
        """Standard error as one line, without the frame that typer draws around wrong use."""
        words = " ".join(line.strip("│╭╮╰╯─ ") for line in self.err.splitlines()).split()
        return " ".join(words)


Run = Callable[..., Answer]
"""The command on one data folder; called with the arguments."""


def simulated(motion: str, name: str, *, wearing: int = 0) -> Take:
    """A take of the one simulated glove of these tests, 20 frames a second."""
    glove = SimulatedGlove(1, "cyberglove18", wearing=wearing)
    return simulate_take(glove, segments(motion, 1), rate_hz=20, name=name).take


def environment(given: Mapping[str, str]) -> dict[str, str]:
    """That of the test, with no settings of Glovecal but those given."""
    mine = {name: value for name, value in os.environ.items() if not name.startswith("GLOVECAL_")}
    return mine | {"COLUMNS": "80", "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"} | dict(given)


def glovecal(settings: Mapping[str, str], *arguments: object) -> Answer:
    """Run a verb in this process, exactly as the script does."""
    out, err = io.StringIO(), io.StringIO()
    code: Any = None
    with _environment(environment(settings)), redirect_stdout(out), redirect_stderr(err):
        try:
            main([str(argument) for argument in arguments])
        except SystemExit as end:
            code = end.code
    _require_runnable(out.getvalue() + err.getvalue())
    return Answer(code or 0, out.getvalue(), err.getvalue())


def _require_runnable(said: str) -> None:
    """Whatever verb a test runs: the commands that it gives to go on with are taken as they are printed."""
    for line in re.findall(r"(?:^|\s)(?:Next|To undo|Continue with): (glovecal .*)$", said, re.MULTILINE):
        assert complaint(with_samples(line)) is None, line


class Started(subprocess.Popen[str]):
    """Its standard error goes to a file: a pipe that nobody reads is full after some hundred lines of a log,
    and then the process stands still."""

    def __init__(self, command: Sequence[str], **options: Any) -> None:
        self._file, self._complaints = tempfile.TemporaryFile(), ""  # noqa: SIM115  # closed by communicate
        super().__init__(command, stdout=subprocess.PIPE, stderr=self._file, text=True, **options)

    @property
    def so_far(self) -> str:
        """What it has complained of while it runs; where it goes on writing stays as it is."""
        return os.pread(self._file.fileno(), 1_000_000, 0).decode(errors="replace")

    def communicate(self, input: str | None = None, timeout: float | None = None) -> tuple[str, str]:
        out, _ = super().communicate(input, timeout)
        if not self._file.closed:
            self._file.seek(0)
            self._complaints = self._file.read().decode(errors="replace")
            self._file.close()
        return out, self._complaints


def start(settings: Mapping[str, str], *arguments: object, **options: Any) -> Started:
    """Run a verb as a process that leads a session of its own, as from a terminal."""
    command = [*COMMAND, *map(str, arguments)]
    return Started(command, env=environment(settings), start_new_session=True, **options)


@contextmanager
def _environment(wanted: Mapping[str, str]) -> Iterator[None]:
    before = dict(os.environ)
    os.environ.clear()
    os.environ.update(wanted)
    try:
        yield
    finally:
        os.environ.clear()
        os.environ.update(before)
