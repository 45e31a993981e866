"""Processes to be killed by tests, started fast: one process imports all, its children are forked from it.

To import the store takes two seconds; what is killed is a process of its own all the same.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import psutil
from jobs_waiting import wait_for


def fork_for_each_line(work: Callable[[], None]) -> None:
    """For each file named on standard input a child does ``work``, its output in that file; prints its id."""
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)  # nobody waits for them: they are gone when they are dead
    for line in sys.stdin:
        child = os.fork()
        if child == 0:
            os.dup2(os.open(line.rstrip("\n"), os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o600), 1)
            work()
            os._exit(0)
        print(child, flush=True)


@dataclass(frozen=True)
class Child:
    id: int
    output: Path

    def lines(self) -> list[str]:
        """What it printed so far; the last line may be half a line."""
        return self.output.read_text().splitlines(keepends=True) if self.output.exists() else []

    def wait_for_lines(self, count: int) -> None:
        wait_for(lambda: len(self.lines()) >= count)

    def kill(self) -> list[str]:
        """kill -9; all that it printed in its life."""
        os.kill(self.id, signal.SIGKILL)
        wait_for(lambda: not psutil.pid_exists(self.id))
        return self.lines()


@contextmanager
def forked(program: Path, folder: Path, *arguments: str) -> Iterator[Callable[[], Child]]:
    """Starts children of ``program``, which calls ``fork_for_each_line``; their outputs are in ``folder``."""
    command = [sys.executable, str(program), *arguments]
    parent = subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, start_new_session=True
    )
    assert parent.stdin is not None
    assert parent.stdout is not None
    to, of = parent.stdin, parent.stdout
    children: list[Child] = []

    def start() -> Child:
        output = folder / f"{program.stem}-{len(children)}.txt"
        print(output, file=to, flush=True)
        children.append(Child(int(of.readline()), output))
        return children[-1]

    try:
        yield start
    finally:
        os.killpg(parent.pid, signal.SIGKILL)
        parent.communicate(timeout=60)
