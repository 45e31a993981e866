"""Work in other processes: whatever ends it, it ends, and leaves no process and no traceback behind."""

from __future__ import annotations

import math
import os
import random
import subprocess
import sys
import time
from itertools import repeat
from pathlib import Path
from typing import Any

import pytest

from glovecal_models.errors import BadInput, Cancelled, WorkerDied
from glovecal_models.worker_processes import shared_workers, side_by_side, work_off

LARGE = bytes(30_000_000)
"""A task that takes much longer to write than a pipe's buffer."""
STOPPED = """
import os, random, signal, threading, time
from glovecal_models.worker_processes import work_off
rng = random.Random(1)
signal.signal(signal.SIGINT, signal.default_int_handler)
tasks = [bytes({size})] * 4
def begin(*_):
    if not timer.ident:
        timer.start()
for turn in range({turns}):
    timer = threading.Timer(0.3 * rng.random(), os.kill, (os.getpid(), signal.SIGINT))
    try:
        try:
            if turn % 2:
                begin()  # else with the first result, when tasks are being written
            while True:
                work_off(len, tasks, 2, begin, "the work")
        finally:
            timer.join()
    except KeyboardInterrupt:
        pass
print("ended", flush=True)
"""


def workers_of(process: int) -> list[int]:
    """The processes of the session that this process began, without itself and without zombies."""
    found = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            state, _, _, session = stat.read_text().rpartition(")")[2].split()[:4]
        except OSError:
            continue  # it ended meanwhile
        if int(session) == process != int(stat.parent.name) and state != "Z":
            found.append(int(stat.parent.name))
    return found


def script(program: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-c", program],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


def wait_until_gone(process: int) -> None:
    deadline = time.monotonic() + 60.0
    while alive := workers_of(process):
        assert time.monotonic() < deadline, alive
        time.sleep(0.02)


def results(work, tasks, workers: int = 2) -> dict[int, object]:
    found: dict[int, object] = {}
    work_off(work, tasks, workers, found.__setitem__, "the work")
    return found


@pytest.mark.parametrize("workers", [1, 2])
def test_each_task_is_worked_off_once(workers: int) -> None:
    assert results(math.factorial, iter(range(20)), workers) == {n: math.factorial(n) for n in range(20)}
    assert results(len, [], workers) == {}


def test_a_task_is_asked_for_when_a_worker_is_free() -> None:
    asked, found = [], []

    def tasks():
        for task in range(6):
            asked.append(task)
            assert len(asked) - len(found) <= 3  # two are worked on while a result is taken
            yield task

    work_off(math.sqrt, tasks(), 2, lambda number, _: found.append(number), "the work")
    assert sorted(found) == asked == list(range(6))


def test_tasks_handed_out_at_once_are_done_beside_other_work(tmp_path) -> None:
    files = [tmp_path / str(number) for number in range(5)]
    for file in files:
        file.touch()
        os.utime(file, (0, 0))
    with shared_workers(2, "the work", None) as stopped:
        touch: Any = os.utime
        done = side_by_side(touch, files, stopped, at_once=True)
        while not all(file.stat().st_mtime for file in files):
            time.sleep(0.01)
        assert list(done) == [None] * 5


def test_a_cancel_ends_it_while_tasks_are_written() -> None:
    rng = random.Random(2)
    for _ in range(6):
        ends: list[float] = []
        after_s = 0.2 * rng.random()
        with pytest.raises(Cancelled, match="the work was cancelled"):
            work_off(
                len,
                repeat(LARGE),
                2,
                lambda *_: ends.append(time.monotonic() + after_s),  # noqa: B023
                "the work",
                lambda: bool(ends) and time.monotonic() > ends[0],  # noqa: B023
            )


def test_ctrl_c_ends_it_at_any_moment_without_a_word() -> None:
    process = script(STOPPED.format(size=len(LARGE), turns=10))
    assert process.communicate(timeout=120) == ("ended\n", "")
    wait_until_gone(process.pid)


def test_nothing_lives_longer_than_a_killed_parent() -> None:
    process = script("""
from glovecal_models.worker_processes import work_off
work_off(eval, ["__import__('time').sleep(print('works') or 600)"] * 2, 2, print, "the work")
""")
    assert process.stderr is not None  # where the prints of workers go
    for _ in range(2):
        assert process.stderr.readline() == "works\n"
    assert len(workers_of(process.pid)) == 2
    process.kill()
    _, said = process.communicate(timeout=60)
    assert said == ""
    wait_until_gone(process.pid)


@pytest.mark.parametrize(
    ("ending", "told"),
    [("os.kill(os.getpid(), 9)", r"signal 9 \(out of memory\?\)"), ("os._exit(3)", "exit code 3")],
)
def test_a_worker_that_dies_is_one_clear_error(ending: str, told: str) -> None:
    tasks = [f"exec('import os; {ending}')", *["__import__('time').sleep(600)"] * 3]
    with pytest.raises(WorkerDied, match=f"the work: a worker process was ended by {told}"):
        results(eval, tasks)


def test_where_no_process_starts_it_is_said(monkeypatch) -> None:
    monkeypatch.setattr(sys, "executable", os.path.join(os.devnull, "python"))
    with pytest.raises(WorkerDied, match="no worker process can be started here; use one worker"):
        results(len, [b"", b""])


def test_errors_of_the_work_keep_their_type_and_say_where_they_were_raised() -> None:
    with pytest.raises(ValueError, match=r"math domain error|nonnegative") as caught:
        results(math.sqrt, [1.0, -1.0])
    assert "in a worker process" in caught.value.__notes__[0]
    with pytest.raises(BadInput, match="no such thing"):
        results(
            eval, ["exec('from glovecal_models.errors import BadInput; raise BadInput(\"no such thing\")')"]
        )
    unpicklable = (
        "exec('class E(Exception):\\n  def __init__(self, a, b): super().__init__(a)\\nraise E(1, 2)')"
    )
    with pytest.raises(RuntimeError, match="E: 1"):
        results(eval, [unpicklable])


@pytest.mark.parametrize(("work", "task"), [(len, lambda: 0), (lambda task: task, 0), (eval, "lambda: 0")])
def test_what_cannot_be_sent_is_an_error_and_no_hang(work, task) -> None:
    with pytest.raises(Exception, match="pickle"):
        results(work, [task])


def test_a_worker_has_one_blas_thread() -> None:
    threads = "{pool['num_threads'] for pool in __import__('threadpoolctl').threadpool_info()}"
    assert results(eval, [threads] * 2) == {0: {1}, 1: {1}}


PINNED = """
from glovecal_models.worker_processes import pin_blas_to_one_thread
pin_blas_to_one_thread()
import scipy.linalg
from threadpoolctl import threadpool_info
print(*{pool["num_threads"] for pool in threadpool_info()}, len(threadpool_info()))
"""


def test_libraries_loaded_later_have_one_thread_too(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        monkeypatch.delenv(name, raising=False)
    with script(PINNED) as process:
        printed, _ = process.communicate(timeout=60)
    threads, libraries = printed.split()
    assert int(threads) == 1
    assert int(libraries) >= 2, "scipy brings a library of its own"
