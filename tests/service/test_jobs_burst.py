"""A burst of trainings: each ends, subjects take turns, and who came last does not wait for all."""

from __future__ import annotations

import pytest
from jobs_waiting import wait_for
from stored_takes import LAYOUT, make_take

from glovecal_service.jobs.dispatcher import Dispatcher
from glovecal_service.questions.catalogue import ANSWERED
from glovecal_service.settings import Settings
from glovecal_service.store import Store


@pytest.mark.parametrize("trainings", [24, pytest.param(500, marks=pytest.mark.slow)])
def test_a_burst_of_trainings_ends_and_is_fair(
    sqlite_store: Store, sqlite_settings: Settings, trainings: int
) -> None:
    store = sqlite_store
    store.layouts.put(LAYOUT)
    takes = {}
    for name in ("anna", "ben", "carla"):
        store.subjects.create(name)
        takes[name] = store.takes.add(make_take(1), subject=name, layout=LAYOUT.name, source="import").id

    def train(name: str, seed: int) -> str:
        payload = {
            "subject": name,
            "layout": LAYOUT.name,
            "takes": [takes[name]],
            "method": "lmc_gpr",
            "samples": 20,
            "folds": 0,
            "seed": seed,
            "activate": False,
        }
        return store.jobs.create("train", payload, subject=name).id

    of_anna = [train("anna", seed) for seed in range(trainings - 5)]
    of_others = [train(name, seed) for seed, name in enumerate(("ben", "ben", "ben", "carla", "carla"))]
    with Dispatcher(store, sqlite_settings, lambda: ANSWERED):
        wait_for(lambda: not store.jobs.unfinished(), 500)
    jobs = {job.id: job for job in store.jobs.list()}
    assert {job.state for job in jobs.values()} == {"done"}, {job.error for job in jobs.values()}
    assert {job.attempt for job in jobs.values()} == {1}
    begun = sorted(jobs.values(), key=lambda job: str(job.started_at))
    places = [place for place, job in enumerate(begun) if job.id in of_others]
    assert max(places) < 10, "five of others are begun among the first ten"
    assert [job.id for job in begun if job.subject == "anna"] == of_anna
    assert len({job.result["model"] for job in jobs.values() if job.result}) > 1
