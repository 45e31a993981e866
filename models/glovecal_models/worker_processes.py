"""Tasks worked off by processes of our own, which end with the call, whatever ends it.

``work_off`` has processes for one kind of work. ``side_by_side`` asks those that some caller further out has
begun: they come with the way in which long work is told to stop, which all of it takes along.

Not ``concurrent.futures``, nor a library built like it (loky, joblib): there the caller's thread shares locks
with the threads that serve the pipes, and a Ctrl-C or a killed worker can leave one taken: the call never
returns. Here the caller's thread only uses queues written in C, in which Ctrl-C leaves nothing half done; all
else happens in threads that no signal interrupts: one starts and ends the workers, and each worker has one
that talks to it, over two pipes, one task at a time.

A worker is a fresh interpreter. It imports the module of its work, not the caller's script, which therefore
needs no ``if __name__ == "__main__":``. It has nothing to lose, so it is killed, after the last task as after
a Ctrl-C; when the caller itself is killed, it sees the end of its pipe and goes. Ctrl-C on a terminal does
not reach it: it is in a process group of its own.

Pickled values travel between a process and the workers it started, through pipes that nobody else can open.

One BLAS thread per process (two made small fits 16 times slower on two cores).
"""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
import threading
import traceback
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from itertools import islice
from queue import Empty, SimpleQueue
from typing import Any, BinaryIO, TypeVar

from threadpoolctl import threadpool_limits

from glovecal_models.errors import WorkerDied
from glovecal_models.progress import Cancel, stop_if

_limits: threadpool_limits | None = None
Task = TypeVar("Task")
Result = TypeVar("Result")

POLL_S = 0.1
"""How long it may take until a call is seen to be cancelled."""
_PROGRAM = (
    "import pickle, sys; requests = open(0, 'rb'); sys.path[:] = pickle.load(requests); "
    "from glovecal_models.worker_processes import serve; serve(requests)"
)
_LENGTH_BYTES = 8
_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


def pin_blas_to_one_thread() -> None:
    """Limit BLAS and OpenMP pools of this process to one thread, for as long as it lives."""
    global _limits
    if _limits is None:
        import numpy.linalg  # noqa: F401  the pools exist only once the libraries are loaded

        os.environ.update(dict.fromkeys(_THREADS, "1"))  # for what is loaded later, as scipy with its own
        _limits = threadpool_limits(limits=1)


def work_off(
    work: Callable[[Task], Result],
    tasks: Iterable[Task],
    workers: int,
    take: Callable[[int, Result], None],
    what: str,
    cancelled: Cancel | None = None,
) -> None:
    """Call ``work`` on each task in one of ``workers`` processes, and ``take`` on its number and its result.

    ``work`` is a function that can be imported, or a ``partial`` of one: each process is sent it once. One
    worker is this process. The next of ``tasks`` is asked for when a worker is free. Results come in any
    order; ``take`` runs in the caller's thread. ``what`` is the whole computation, for messages ("the
    training"). Raises Cancelled, WorkerDied, and what ``work``, ``take`` and ``tasks`` raise. No worker
    outlives the call.
    """
    if workers == 1:
        for number, task in enumerate(tasks):
            stop_if(cancelled, what)
            take(number, work(task))
        return
    pool = _Pool(workers, what)
    try:
        pool.begin()
        for number, result in pool.results(work, tasks, cancelled):
            take(number, result)
    finally:
        pool.end()


@contextmanager
def shared_workers(workers: int, what: str, cancelled: Cancel | None) -> Iterator[Cancel | None]:
    """``cancelled`` with so many processes, which ``side_by_side`` uses and which end with the block; one:
    this process.

    ``what`` as in ``work_off``.
    """
    if workers == 1:
        yield cancelled
        return
    pool = _Pool(workers, what)
    try:
        pool.begin()
        yield _CancelWithPool(cancelled, pool)
    finally:
        pool.end()


def side_by_side(
    work: Callable[[Task, Cancel | None], Result],
    tasks: Sequence[Task],
    cancelled: Cancel | None = None,
    *,
    at_once: bool = False,
) -> Iterator[Result]:
    """``work`` of each task, in the order of ``tasks``, by the ``shared_workers`` that ``cancelled`` brings,
    which begin when this is called. Where there are none this process does it, each when it is asked for.

    ``work`` as in ``work_off``; it is also told when to stop, unless in a worker, which is ended. Whoever
    asks for no further result leaves the rest undone, unless all tasks are handed out ``at_once``, to be done
    beside other work. Raises Cancelled, WorkerDied, and of what ``work`` raises the error of the first task.
    """
    pool = cancelled.pool if isinstance(cancelled, _CancelWithPool) else None
    if pool is None or len(tasks) < 2:
        return (work(task, cancelled) for task in tasks)
    safe = partial(_result_or_error, work)
    return _in_order(pool.results(safe, tasks, cancelled, len(tasks) if at_once else None))


def _in_order(results: Iterator[tuple[int, Result | Exception]]) -> Iterator[Result]:
    early: dict[int, Result | Exception] = {}
    wanted = 0
    for number, result in results:
        early[number] = result
        while wanted in early:
            outcome = early.pop(wanted)
            if isinstance(outcome, Exception):
                raise outcome
            yield outcome
            wanted += 1


def _result_or_error(work: Callable[[Task, None], Result], task: Task) -> Result | Exception:
    """What tasks raise comes in their order, too."""
    try:
        return work(task, None)
    except Exception as error:
        return _portable(error)


_STOP = None


@dataclass(frozen=True)
class _Order:
    work: Callable[[Any], Any]
    number: int
    task: Any
    answers: SimpleQueue[Any]

    def answer(self, result: Any, error: BaseException | None = None) -> None:
        self.answers.put((self.number, result, error))


class _Pool:
    """Processes that are begun when an order needs one, for several calls."""

    def __init__(self, workers: int, what: str) -> None:
        self._workers, self._what = workers, what
        self._orders: SimpleQueue[Any] = SimpleQueue()
        self._ended: SimpleQueue[Any] = SimpleQueue()
        self._overseer = threading.Thread(target=self._oversee, daemon=True)

    def begin(self) -> None:
        self._overseer.start()

    def end(self) -> None:
        self._orders.put(_STOP)
        if self._overseer.ident is not None:  # else it has begun no worker
            self._ended.get()

    def results(
        self,
        work: Callable[[Task], Result],
        tasks: Iterable[Task],
        cancelled: Cancel | None,
        ahead: int | None = None,
    ) -> Iterator[tuple[int, Result]]:
        """The number and the result of each task, in any order; so many tasks are handed out ``ahead``, one
        for each worker by default, when this is called."""
        answers: SimpleQueue[Any] = SimpleQueue()
        orders = (_Order(work, number, task, answers) for number, task in enumerate(tasks))
        return self._answers(answers, orders, self._ordered(orders, ahead or self._workers), cancelled)

    def _ordered(self, orders: Iterator[_Order], most: int) -> int:
        """How many of the next ``most`` there were."""
        count = 0
        for order in islice(orders, most):
            self._orders.put(order)
            count += 1
        return count

    def _answers(
        self,
        answers: SimpleQueue[Any],
        orders: Iterator[_Order],
        unanswered: int,
        cancelled: Cancel | None,
    ) -> Iterator[tuple[int, Any]]:
        while unanswered:
            stop_if(cancelled, self._what)
            try:
                number, result, error = answers.get(timeout=POLL_S)
            except Empty:
                continue
            if error is not None:
                raise error
            unanswered += self._ordered(orders, 1) - 1
            yield number, result

    def _oversee(self) -> None:
        """Hand each order to a worker that is free, or to a new one; at ``_STOP`` end all of them."""
        workers: list[_Worker] = []
        free: list[_Worker] = []
        waiting: deque[_Order] = deque()
        try:
            while (order := self._orders.get()) is not _STOP:
                if isinstance(order, _Worker):
                    free.append(order)
                else:
                    waiting.append(order)
                while waiting and (free or len(workers) < self._workers):
                    if not free:
                        free.append(_Worker(self._what, self._orders))
                        workers.append(free[-1])
                    free.pop().orders.put(waiting.popleft())
        except BaseException as error:
            for order in waiting:
                order.answer(None, error)
            while (order := self._orders.get()) is not _STOP:
                if isinstance(order, _Order):
                    order.answer(None, error)
        finally:
            for worker in workers:
                worker.kill()
            for worker in workers:
                worker.thread.join()
            self._ended.put(_STOP)


@dataclass(frozen=True)
class _CancelWithPool:
    """A ``Cancel`` that brings processes."""

    cancelled: Cancel | None
    pool: _Pool

    def __call__(self) -> bool:
        return self.cancelled is not None and self.cancelled()


class _Worker:
    """A process and the thread that talks to it. Puts itself into ``frees`` when it has answered."""

    def __init__(self, what: str, frees: SimpleQueue[Any]) -> None:
        self.orders: SimpleQueue[Any] = SimpleQueue()
        self._what, self._frees = what, frees
        self._process: subprocess.Popen[bytes] | None = None
        self._work: object = None
        """That the process was sent last."""
        self._killed = False
        self.thread = threading.Thread(target=self._run, daemon=True)
        self.thread.start()

    def kill(self) -> None:
        self._killed = True
        self.orders.put(_STOP)
        if self._process is not None:
            self._process.kill()

    def _run(self) -> None:
        try:
            while (order := self.orders.get()) is not _STOP:
                result, error = self._worked_off(order)
                self._frees.put(self)
                order.answer(result, error)
        finally:
            if self._process is not None:
                _end(self._process)

    def _worked_off(self, order: _Order) -> tuple[Any, BaseException | None]:
        try:
            process = self._process = self._process or _begin()
            if self._killed:  # too early for it to see the process
                process.kill()
            assert process.stdin is not None
            assert process.stdout is not None
            _send(process.stdin, (None if order.work is self._work else order.work, order.task))
            result, error = pickle.loads(_received(process.stdout))
            self._work = order.work if error is None else None
        except (OSError, EOFError):
            return None, WorkerDied(self._how_it_ended())
        except BaseException as error:
            return None, error
        return result, error

    def _how_it_ended(self) -> str:
        if self._process is None:
            return f"{self._what}: no worker process can be started here; use one worker"
        code = self._process.wait()
        how = (
            f"signal {-code}{' (out of memory?)' if code == -9 else ''}" if code < 0 else f"exit code {code}"
        )
        return f"{self._what}: a worker process was ended by {how}; use fewer workers"


def _begin() -> subprocess.Popen[bytes]:
    process = subprocess.Popen(
        [sys.executable, "-P", "-c", _PROGRAM],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        # OpenMP (boosted trees) too: its threads wait by spinning, and workers would slow each other down.
        env=os.environ | {"OMP_NUM_THREADS": "1"},
        process_group=0,
        creationflags=getattr(subprocess, "CREATE_NEW_PROCESS_GROUP", 0),  # the same for Windows
    )
    try:
        assert process.stdin is not None
        pickle.dump([place for place in sys.path if isinstance(place, str)], process.stdin)
    except BaseException:
        _end(process)
        raise
    return process


def _end(process: subprocess.Popen[bytes]) -> None:
    process.kill()
    for stream in (process.stdin, process.stdout):
        with suppress(OSError):  # what was not sent yet cannot be any more
            if stream is not None:
                stream.close()
    process.wait()


def _send(stream: BinaryIO | Any, value: object) -> None:
    _send_bytes(stream, pickle.dumps(value, pickle.HIGHEST_PROTOCOL))


def _send_bytes(stream: BinaryIO | Any, data: bytes) -> None:
    stream.write(len(data).to_bytes(_LENGTH_BYTES, "little"))
    stream.write(data)
    stream.flush()


def _received(stream: BinaryIO | Any) -> bytes:
    """Raises EOFError when the other side is gone."""
    length = int.from_bytes(_read(stream, _LENGTH_BYTES), "little")
    return _read(stream, length)


def _read(stream: BinaryIO | Any, length: int) -> bytes:
    data = stream.read(length)
    if len(data) < length:
        raise EOFError
    return data


def serve(requests: BinaryIO) -> None:
    """A worker's life, in a process of its own. Never returns."""
    try:
        _serve(requests)
    except OSError:
        pass  # the caller is gone
    except BaseException:
        traceback.print_exc()
    finally:
        os._exit(1)  # an ordinary end would wait for the thread that reads


def _serve(requests: BinaryIO) -> None:
    answers = os.fdopen(os.dup(1), "wb")
    _send_prints_to_stderr()
    received: SimpleQueue[bytes] = SimpleQueue()
    threading.Thread(target=_receive, args=(requests, received), daemon=True).start()
    pin_blas_to_one_thread()
    work: Any = None
    while True:
        sent = received.get()
        try:
            new_work, task = pickle.loads(sent)
            work = new_work or work
            answer = pickle.dumps((work(task), None), pickle.HIGHEST_PROTOCOL)
        except Exception as error:
            answer = pickle.dumps((None, _portable(error)))
        _send_bytes(answers, answer)


def _receive(requests: BinaryIO, received: SimpleQueue[bytes]) -> None:
    """Reads all the time, also while a task runs: the end of the pipe is the end of the caller."""
    try:
        while True:
            received.put(_received(requests))
    finally:
        os._exit(1)


def _send_prints_to_stderr() -> None:
    """Standard output carries answers, and libraries print to it."""
    sys.stdout = sys.stderr
    try:
        os.dup2(2, 1)
    except OSError:  # standard error is closed
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)


def _portable(error: Exception) -> Exception:
    """The error with a note of where it was raised, or a description where it cannot be pickled."""
    note = f"Raised in a worker process:\n{traceback.format_exc()}"
    error.add_note(note)
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:
        error = RuntimeError(f"{type(error).__name__}: {error}")
        error.add_note(note)
    return error
