"""The dispatcher with real worker processes: results, memory of results, cancel, crashes, restarts."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import jobs_process
import psutil
import pytest
from jobs_counting import CountingJob, noted
from jobs_waiting import error_of, result_of, wait_for, wait_for_job

from glovecal_service.jobs import job_run, workers
from glovecal_service.jobs.dispatcher import Dispatcher
from glovecal_service.jobs.job_kind import TaskResult
from glovecal_service.jobs.owner import Owner
from glovecal_service.questions.catalogue import ANSWERED


@pytest.fixture
def ledger(tmp_path):
    return tmp_path / "ledger"


def create(store, ledger, numbers, seconds=0.0, **more):
    payload = {"numbers": numbers, "seconds": seconds, "ledger": str(ledger), **more}
    return store.jobs.create("count", payload)


def test_a_job_runs_in_polite_worker_processes(dispatched, ledger):
    store, dispatcher = dispatched
    result = result_of(store, create(store, ledger, [3, 4, 5, 6]).id)
    assert result["sums"] == [6, 10, 15, 21]
    for facts in result["facts"]:
        assert facts["niceness"] == 10
        assert facts["blas_threads"] == 1
        assert facts["pid"] in dispatcher.workers.pids()
        assert facts["pid"] != os.getpid()


def test_one_command_runs_a_single_task_itself(sqlite_store, sqlite_settings, ledger):
    before = os.nice(0)
    with Dispatcher(
        sqlite_store, sqlite_settings, lambda: {"count": CountingJob()}, of_one_command=True
    ) as dispatcher:
        (facts,) = result_of(sqlite_store, create(sqlite_store, ledger, [4]).id)["facts"]
        assert facts["pid"] == os.getpid()
        assert facts["niceness"] == 10
        assert not dispatcher.workers.started
        job = create(sqlite_store, ledger, [5], seconds=600)
        wait_for(lambda: 5 in noted(ledger, "begin"))
        sqlite_store.jobs.request_cancel(job.id)
        assert wait_for_job(sqlite_store, job.id).state == "cancelled"
    assert os.nice(0) == before, "the thread alone steps back"


def test_progress_is_told_task_by_task_and_kept(dispatched, ledger):
    store, _ = dispatched
    job = wait_for_job(store, create(store, ledger, [3, 4, 5]).id)
    events = store.jobs.events(job.id)
    fractions = [event.fraction for event in events]
    assert fractions == sorted(fractions)
    assert {f"sum to {number} done" for number in (3, 4, 5)} <= {event.sentence for event in events}
    assert [event.state for event in (events[0], events[1], events[-1])] == ["queued", "running", "done"]
    assert store.jobs.events(job.id, after=events[-2].id) == events[-1:]


def test_what_was_computed_once_is_not_computed_again(dispatched, ledger):
    store, _ = dispatched
    assert result_of(store, create(store, ledger, [1, 2, 3]).id)["sums"] == [1, 3, 6]
    assert result_of(store, create(store, ledger, [3, 2, 7]).id)["sums"] == [6, 3, 28]
    assert sorted(noted(ledger, "done")) == [1, 2, 3, 7]


def test_cancelling_stops_the_fits_in_flight(dispatched, ledger):
    store, _ = dispatched
    job = create(store, ledger, [1, 2, 3, 4, 5, 6], seconds=600)
    wait_for(lambda: len(noted(ledger, "begin")) >= 2)
    store.jobs.request_cancel(job.id)
    job = wait_for_job(store, job.id)
    assert (job.state, job.sentence, job.result) == ("cancelled", "cancelled", None)
    assert result_of(store, create(store, ledger, [10]).id)["sums"] == [55]
    assert noted(ledger, "done") == [10]


def test_a_queued_job_is_cancelled_at_once(sqlite_store):
    job = sqlite_store.jobs.create("count", {})
    assert sqlite_store.jobs.request_cancel(job.id).state == "cancelled"
    assert sqlite_store.jobs.claim("anybody") is None


def test_a_killed_worker_is_replaced_and_its_fit_repeated(dispatched, ledger):
    store, _ = dispatched
    job = create(store, ledger, [1, 2, 3], seconds=0.3)
    wait_for(lambda: noted(ledger, "begin"))
    victim = int(ledger.read_text().splitlines()[0].split()[2])
    os.kill(victim, signal.SIGKILL)
    result = result_of(store, job.id)
    assert result["sums"] == [1, 3, 6]
    assert victim not in {facts["pid"] for facts in result["facts"]}


def test_a_fit_that_kills_every_worker_fails_with_a_reason(dispatched, ledger):
    store, _ = dispatched
    job = wait_for_job(store, create(store, ledger, [4], ending="die").id)
    assert job.state == "failed"
    assert job.error == "sum to 4: every process that worked on it died (killed, or out of memory)"
    assert wait_for_job(store, create(store, ledger, [5]).id).state == "done"


def test_a_refusal_is_passed_on_and_a_mistake_is_called_one(dispatched, ledger):
    store, _ = dispatched
    refused = wait_for_job(store, create(store, ledger, [1], ending="refuse").id)
    assert (refused.state, refused.error) == ("failed", "sum to 1: the samples are all alike")
    broken = wait_for_job(store, create(store, ledger, [2], ending="break").id)
    assert broken.error == "an error in Glovecal itself (ZeroDivisionError): the job's traceback tells where"
    assert refused.traceback is None, "its sentence says everything"
    assert broken.traceback is not None
    assert "in count\n" in broken.traceback, "the calls inside the worker process"
    assert broken.traceback.rstrip().endswith("ZeroDivisionError: a mistake in the program")
    unknown = wait_for_job(store, store.jobs.create("knit", {}).id)
    kinds = ", ".join(sorted([*ANSWERED, "count"]))
    assert unknown.error == f"no job of kind 'knit'; there are {kinds}"


def test_a_process_that_cannot_start_is_told_and_its_own_words_are_logged(
    sqlite_store, sqlite_settings, ledger, tmp_path
):
    """Whatever breaks it: here a package that only children import."""
    broken = tmp_path / "broken"
    broken.mkdir()
    (broken / "dask.py").write_text("raise ValueError('the installation is damaged')\n")
    job = create(sqlite_store, ledger, [1])
    program = Path(jobs_process.__file__)
    command = [sys.executable, str(program), str(sqlite_settings.data), "", str(broken)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=500)
    assert done.returncode == 0
    told = error_of(sqlite_store, job.id)
    assert "none can import what it needs; install Glovecal again" in told
    assert "the installation is damaged" not in told
    assert "ValueError: the installation is damaged" in done.stderr, "the log has it"


def test_stopping_leaves_the_job_for_the_next_start(sqlite_store, sqlite_settings, ledger):
    with Dispatcher(sqlite_store, sqlite_settings, lambda: {"count": CountingJob()}):
        job = create(sqlite_store, ledger, [1, 2, 3], seconds=0.2, here=True)
        wait_for(lambda: noted(ledger, "done"))
    assert sqlite_store.jobs.get(job.id).state == "queued"
    done = noted(ledger, "done")
    with Dispatcher(sqlite_store, sqlite_settings, lambda: {"count": CountingJob()}):
        assert result_of(sqlite_store, job.id)["sums"] == [1, 3, 6]
    assert noted(ledger, "done")[: len(done)] == done
    assert sorted(noted(ledger, "done")) == [1, 2, 3]
    assert not list((sqlite_settings.data / "owners").iterdir())


def test_a_predecessor_that_lives_keeps_its_jobs(sqlite_store, sqlite_settings):
    folder = sqlite_settings.data / "owners"
    living, successor = Owner(folder), Owner(folder)
    job = sqlite_store.jobs.create("count", {})
    sqlite_store.jobs.claim(living.name)
    assert successor.take_back_from_dead(sqlite_store) == 0
    living._file.close()  # pyright: ignore[reportOptionalMemberAccess]  # what the operating system does when the process dies
    assert successor.take_back_from_dead(sqlite_store) == 1
    assert sqlite_store.jobs.get(job.id).state == "queued"
    successor.close()


def test_the_scheduler_can_be_lost_in_the_middle_of_a_job(dispatched, ledger):
    store, dispatcher = dispatched
    job = create(store, ledger, [1, 2, 3, 4], seconds=0.3)
    wait_for(lambda: noted(ledger, "done"))
    dispatcher.workers._cluster.close()
    assert result_of(store, job.id)["sums"] == [1, 3, 6, 10]
    assert len(noted(ledger, "done")) <= 6, "only the two fits in flight may be repeated"


def test_processes_that_never_come_back_are_replaced(dispatched, ledger, monkeypatch):
    store, dispatcher = dispatched
    lost = dispatcher.workers._started()
    dispatcher.workers._cluster.scale(0)
    wait_for(lambda: not dispatcher.workers._cluster.scheduler.workers)
    monkeypatch.setattr(workers, "LONGEST_ABSENCE_S", 1.0)
    job = create(store, ledger, [1, 2, 3])
    wait_for(lambda: dispatcher.workers._client is not lost)
    monkeypatch.undo()  # however long the new ones take to come
    assert result_of(store, job.id)["sums"] == [1, 3, 6]


def test_a_job_goes_on_through_any_number_of_losses_between_which_it_gets_on(dispatched, ledger, monkeypatch):
    """As on a busy computer for hours: the processes are lost after each result."""
    store, _ = dispatched
    hand_out, losses, numbers = workers.Workers.submit, 0, list(range(1, 2 * job_run.WORKER_RESTARTS + 5))

    def submit(self, task, *files):
        nonlocal losses
        results = sum(event.sentence.endswith(" done") for event in store.jobs.events(job.id))
        if results > losses:
            losses += 1
            raise workers.WorkersLost("they went away")
        return hand_out(self, task, *files)

    job = create(store, ledger, numbers, seconds=0.02)
    monkeypatch.setattr(workers.Workers, "submit", submit)
    assert len(result_of(store, job.id)["sums"]) == len(numbers)
    assert losses > job_run.WORKER_RESTARTS


def test_what_was_told_counts_although_the_process_went_right_after(dispatched, sqlite_store, ledger):
    """The result has come by itself: nobody has to fetch it from a process that may be gone."""
    _, dispatcher = dispatched
    [task] = CountingJob().plan(sqlite_store, create(sqlite_store, ledger, [2])).tasks
    handed = dispatcher.workers.submit(task, lambda *_: None)
    wait_for(lambda: handed.is_over)
    dispatcher.workers.reset()
    assert TaskResult.from_bytes(handed.outcome.result).arrays["sum"] == 3


def test_another_job_may_replace_the_processes_in_the_middle(dispatched, sqlite_store, ledger):
    _, dispatcher = dispatched
    [task] = CountingJob().plan(sqlite_store, create(sqlite_store, ledger, [2], seconds=600)).tasks
    handed = dispatcher.workers.submit(task, lambda *_: None)
    wait_for(lambda: noted(ledger, "begin"))
    dispatcher.workers.reset()
    wait_for(lambda: handed.is_over)
    with pytest.raises(workers.WorkersLost):
        _ = handed.outcome


def test_an_error_of_a_task_is_not_taken_for_a_lost_worker(dispatched, ledger):
    """Also one that says what the system says of a broken connection; nothing is tried again."""
    store, dispatcher = dispatched
    client = dispatcher.workers._started()
    job = wait_for_job(store, create(store, ledger, [2], ending="network").id)
    assert job.error == "an error in Glovecal itself (ConnectionResetError): the job's traceback tells where"
    assert noted(ledger, "begin") == [2]
    assert dispatcher.workers._client is client


def test_a_worker_touches_nothing_of_the_data_folder(dispatched, ledger):
    """What it found is kept by this process alone."""
    store, dispatcher = dispatched
    [facts] = result_of(store, create(store, ledger, [6]).id)["facts"]
    files = [Path(item.path) for item in psutil.Process(facts["pid"]).open_files()]
    folder = dispatcher._folder.parent.resolve()
    assert [file for file in files if file.is_relative_to(folder) and "workers" not in file.parts] == []
