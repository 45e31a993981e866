"""Runs a page's commands as its reader would: one after another, in one folder, with data of their own."""

from __future__ import annotations

import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from types import TracebackType
from typing import IO

from transcripts.page import Command, File

ROOT = Path(__file__).resolve().parents[2]
AS_IN_A_CHECKOUT = ("do.py", ".venv", "client", "tests")
LONGEST_S = 3600.0
FIRST_LINE_S = 120.0
"""For the first line of a command in the background, and for those that the page promises."""
END_S = 20.0


class CommandFailed(Exception):
    """A command that ended with an error, or never; its text is what was printed."""


class Shell:
    """A new folder in which the paths of a checkout lead to this one; ports that are free.

    As context manager: what runs in the background ends with it, and the folder goes.
    """

    def __init__(self) -> None:
        self.folder = Path(tempfile.mkdtemp(prefix="glovecal-pages-"))
        for name in AS_IN_A_CHECKOUT:
            if (ROOT / name).exists():
                (self.folder / name).symlink_to(ROOT / name)
        self._port, self._zenoh_port = _free_ports(2)
        self._background: list[subprocess.Popen[bytes]] = []

    def __enter__(self) -> Shell:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.end_background()
        shutil.rmtree(self.folder, ignore_errors=True)

    def write(self, file: File) -> None:
        path = self.folder / file.name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(file.content.replace(":7447", f":{self._zenoh_port}"), encoding="utf-8")

    def run(self, text: str, command: Command) -> list[str]:
        """The lines that ``text`` prints, as ``command`` of a page. Raises CommandFailed."""
        if command.in_background:
            return self._start(text, max(1, len(command.promised)))
        process = self._popen(text, subprocess.PIPE)
        try:
            printed, _ = process.communicate(timeout=LONGEST_S)
        except subprocess.TimeoutExpired as late:
            raise CommandFailed(f"no end after {LONGEST_S:.0f} s:\n{_text(late.stdout)}") from late
        finally:
            _end(process)
        if process.returncode != 0 and not command.promised:
            raise CommandFailed(f"ended with code {process.returncode}:\n{_text(printed)}")
        return self._lines(printed)

    def end_background(self) -> None:
        for process in reversed(self._background):
            _end(process)
        self._background.clear()

    def _start(self, text: str, lines: int) -> list[str]:
        alone = text.partition(" #")[0].rstrip().removesuffix("&")
        said = self.folder / f".said-{len(self._background)}"
        with said.open("wb") as written:
            process = self._popen(f"exec {alone}", written)
        self._background.append(process)
        until = time.monotonic() + FIRST_LINE_S
        while said.read_bytes().count(b"\n") < lines:
            if process.poll() is not None or time.monotonic() > until:
                raise CommandFailed(f"printed fewer than {lines} lines:\n{_text(said.read_bytes())}")
            time.sleep(0.05)
        return self._lines(said.read_bytes())

    def _popen(self, text: str, written: IO[bytes] | int) -> subprocess.Popen[bytes]:
        return subprocess.Popen(
            ["bash", "-c", text], cwd=self.folder, env=self._environment(), stdin=subprocess.DEVNULL,
            stdout=written, stderr=subprocess.STDOUT, start_new_session=True,
        )  # fmt: skip

    def _lines(self, printed: bytes) -> list[str]:
        text = _text(printed).replace(f"{self.folder}/", "").replace(str(self.folder), ".")
        text = re.sub(rf":{self._port}\b", ":8600", text)
        return re.sub(rf":{self._zenoh_port}\b", ":7447", text).splitlines()

    def _environment(self) -> dict[str, str]:
        """Output and errors in the order in which a terminal shows them; one thread, as ``do.py`` has it."""
        mine = {
            name: value for name, value in os.environ.items() if not name.startswith(("GLOVECAL", "PYTHON"))
        }
        binaries = os.pathsep.join([str(Path(sys.executable).parent), mine.get("PATH", os.defpath)])
        threads = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
        return mine | threads | {
            "PATH": binaries,
            "PYTHONUNBUFFERED": "1",
            "MPLBACKEND": "Agg",
            "GLOVECAL_DATA": str(self.folder / "glovecal-data"),
            "GLOVECAL_PORT": str(self._port),
            "GLOVECAL_ZENOH": f"tcp/127.0.0.1:{self._zenoh_port}",
        }  # fmt: skip


def _end(process: subprocess.Popen[bytes]) -> None:
    """As Ctrl-C does it, to the command and all that it started; if that is not heard, without asking."""
    if process.poll() is not None:
        return
    os.killpg(process.pid, signal.SIGINT)
    try:
        process.wait(END_S)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()


def _text(printed: bytes | None) -> str:
    return (printed or b"").decode("utf-8", "replace")


def _free_ports(count: int) -> list[int]:
    sockets = [socket.create_server(("127.0.0.1", 0)) for _ in range(count)]
    try:
        return [each.getsockname()[1] for each in sockets]
    finally:
        for each in sockets:
            each.close()
