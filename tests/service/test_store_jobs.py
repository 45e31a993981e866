"""Job rows: each claimed once, written by its present attempt only, never lost."""

import threading
from collections import Counter
from datetime import timedelta

import pytest

from glovecal_models.errors import BadInput
from glovecal_service.store import Store
from glovecal_service.store.database import now
from glovecal_service.store.errors import Conflict, NotFound
from glovecal_service.store.jobs import LEASE_S


class Clock:
    """Seconds that pass only when told to."""

    def __init__(self) -> None:
        self.time = 1_000_000.0

    def __call__(self) -> float:
        return self.time


@pytest.fixture
def clock():
    return Clock()


@pytest.fixture
def timed(store_settings, clock):
    with Store.open(store_settings, clock=clock) as store:
        yield store


def test_many_claimers_take_each_job_once(store):
    ids = [store.jobs.create("train", {"number": number}).id for number in range(60)]
    claimed: list[str] = []

    def claim(owner: str) -> None:
        while job := store.jobs.claim(owner):
            claimed.append(job.id)
            store.jobs.finish(job.id, job.attempt, {"by": owner})

    threads = [threading.Thread(target=claim, args=(f"claimer-{number}",)) for number in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    while job := store.jobs.claim("last"):  # a claimer gives up when the row it looked at was taken
        claimed.append(job.id)
    assert Counter(claimed) == Counter(ids)


def test_jobs_are_claimed_in_the_order_they_came(store):
    ids = [store.jobs.create("train", {}).id for _ in range(5)]
    assert [job.id for job in iter(lambda: store.jobs.claim("me"), None)] == ids


def test_subjects_take_turns(store):
    """Who comes with three after somebody else's hundreds waits for a few of them."""
    for name in ("anna", "ben", "carla"):
        store.subjects.create(name)
    queue = ["anna"] * 20 + ["ben"] * 3 + ["carla"] * 2
    ids = [store.jobs.create("train", {}, subject=name).id for name in queue]
    claimed = list(iter(lambda: store.jobs.claim("me"), None))
    assert [job.subject for job in claimed[:9]] == [*["anna", "ben", "carla"] * 2, "anna", "ben", "anna"]
    assert sorted(job.id for job in claimed) == sorted(ids)
    of_anna = [job.id for job in claimed if job.subject == "anna"]
    assert of_anna == ids[:20], "each in the order in which it came"


def test_a_job_that_runs_past_its_lease_is_taken_over(timed, clock):
    job = timed.jobs.create("train", {"subject": "anna"})
    first = timed.jobs.claim("first")
    clock.time += LEASE_S - 1
    timed.jobs.heartbeat(job.id, first.attempt)
    clock.time += LEASE_S - 1
    assert timed.jobs.claim("second") is None
    clock.time += 2
    second = timed.jobs.claim("second")
    assert (second.id, second.attempt, second.owner) == (job.id, 2, "second")
    for write in (
        lambda: timed.jobs.heartbeat(job.id, first.attempt),
        lambda: timed.jobs.progress(job.id, first.attempt, 0.9, "nearly"),
        lambda: timed.jobs.finish(job.id, first.attempt, {"model": "wrong"}),
        lambda: timed.jobs.fail(job.id, first.attempt, "wrong"),
        lambda: timed.jobs.cancelled(job.id, first.attempt),
        lambda: timed.jobs.release(job.id, first.attempt),
    ):
        with pytest.raises(Conflict, match="attempt 1 of job"):
            write()
    assert timed.jobs.finish(job.id, second.attempt, {"model": "right"}).result == {"model": "right"}
    with pytest.raises(Conflict):
        timed.jobs.finish(job.id, second.attempt, {"model": "twice"})


def test_the_third_loss_is_the_last(timed, clock):
    job = timed.jobs.create("train", {})
    for _ in range(3):
        assert timed.jobs.claim("doomed").id == job.id
        clock.time += LEASE_S + 1
    assert timed.jobs.claim("doomed") is None
    lost = timed.jobs.get(job.id)
    assert lost.state == "failed"
    assert lost.error == "given up: the process that ran it died 3 times"


def test_a_service_that_stops_loses_nothing(timed):
    job = timed.jobs.create("train", {})
    for attempt in range(1, 8):
        assert timed.jobs.claim("polite").attempt == attempt
        assert timed.jobs.release(job.id, attempt).state == "queued"


def test_a_service_that_stops_cancels_what_was_to_be_cancelled(timed):
    job = timed.jobs.create("train", {})
    timed.jobs.claim("polite")
    timed.jobs.request_cancel(job.id)
    released = timed.jobs.release(job.id, 1)
    assert (released.state, released.sentence) == ("cancelled", "cancelled")
    assert timed.jobs.events(job.id)[-1].state == "cancelled"
    assert timed.jobs.claim("next") is None


def test_a_cancelled_job_whose_runner_died_is_cancelled(timed, clock):
    job = timed.jobs.create("train", {})
    timed.jobs.claim("doomed")
    assert timed.jobs.request_cancel(job.id).state == "running"
    assert timed.jobs.heartbeat(job.id, 1).cancel_requested
    clock.time += LEASE_S + 1
    assert timed.jobs.claim("next") is None
    assert timed.jobs.get(job.id).state == "cancelled"
    assert timed.jobs.request_cancel(job.id).state == "cancelled"


def test_steps_of_jobs_that_are_over_are_forgotten_and_the_jobs_stay(store):
    over, waiting = store.jobs.create("train", {}), store.jobs.create("train", {})
    store.jobs.request_cancel(over.id)
    assert store.jobs.forget_steps(now() - timedelta(days=1)) == 0
    steps = len(store.jobs.events(over.id))
    assert store.jobs.forget_steps(now() + timedelta(seconds=1)) == steps > 0
    assert store.jobs.events(over.id) == []
    assert store.jobs.get(over.id).state == "cancelled"
    assert store.jobs.events(waiting.id) != []


def test_only_the_dead_owners_jobs_are_queued_again(store):
    one, two = store.jobs.create("train", {}), store.jobs.create("train", {})
    store.jobs.claim("dead")
    store.jobs.claim("alive")
    assert store.jobs.owners() == {"dead", "alive"}
    assert store.jobs.requeue_of("dead") == 1
    assert [store.jobs.get(job.id).state for job in (one, two)] == ["queued", "running"]


def test_lists_and_bad_requests(store):
    one = store.jobs.create("train", {}, subject="anna")
    two = store.jobs.create("compare", {}, subject="ben")
    assert [job.id for job in store.jobs.list()] == [two.id, one.id]
    assert [job.id for job in store.jobs.list(subject="anna")] == [one.id]
    store.jobs.request_cancel(two.id)
    assert [job.id for job in store.jobs.list(only_unfinished=True)] == [one.id]
    for call in (store.jobs.get, store.jobs.events, store.jobs.request_cancel):
        with pytest.raises(NotFound, match="'none'"):
            call("none")
    with pytest.raises(BadInput):
        store.jobs.create("train", {"x": float("nan")})
    with pytest.raises(BadInput):
        store.jobs.create("../train", {})


def test_any_message_can_be_kept(store):
    for sentence in ("a\0b", "\ud800", "x" * 10_000, "", "手"):
        job = store.jobs.create("train", {})
        store.jobs.claim("me")
        store.jobs.progress(job.id, 1, 0.5, sentence)
        assert len(store.jobs.fail(job.id, 1, sentence).error) <= 2000
    for id in ("a\0b", "\ud800"):
        with pytest.raises((NotFound, BadInput)):
            store.jobs.get(id)
