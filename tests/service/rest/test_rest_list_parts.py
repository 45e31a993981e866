"""Long lists come in parts; who asks for no part gets all of it."""

from __future__ import annotations

import numpy as np
import pytest

from glovecal_client.errors import ServiceError
from glovecal_client.rest import RestClient
from glovecal_models.takes.take import Take
from glovecal_service.rest.http.list_part import USUAL_LIMIT
from glovecal_service.settings import Settings
from glovecal_service.store import Store

EVERY = [f"fist {number}" for number in range(7)]


@pytest.fixture(autouse=True)
def rows(settings: Settings, client: RestClient) -> None:
    """Seven takes of anna and three jobs."""
    with Store.open(settings) as store:
        store.subjects.create("anna")
        for number, name in enumerate(EVERY):
            time_s = np.arange(5) / 100
            readings = np.random.default_rng(number).uniform(0, 255, (5, 3))
            store.takes.add(
                Take(name, "w", ("a", "b", "c"), time_s, readings), subject="anna", layout="three",
                source="import",
            )  # fmt: skip
        for kind in ("train", "diagnose", "train"):
            store.jobs.request_cancel(store.jobs.create(kind, {"model": "0123"}, subject="anna").id)


def names(client: RestClient, **query: object) -> list[str]:
    return [take["name"] for take in client.get("/takes", query)]


def test_parts_in_either_order_hold_every_row_once(client: RestClient) -> None:
    for reverse in (False, True):
        parts = [names(client, limit=3, offset=offset, reverse=reverse) for offset in (0, 3, 6, 9)]
        assert [len(part) for part in parts] == [3, 3, 1, 0]
        assert [name for part in parts for name in part] == (EVERY[::-1] if reverse else EVERY)


def test_the_answer_says_what_comes_after_it(client: RestClient) -> None:
    answer = client._send("GET", "/takes", params={"limit": 5, "text": "fist"})
    assert answer.headers["X-Total-Count"] == "7"
    assert answer.links["next"]["url"] == "?text=fist&limit=5&offset=5"
    assert "next" not in client._send("GET", "/takes", params={"limit": 5, "offset": 5}).links


def test_a_client_gets_all_parts(settings: Settings, client: RestClient) -> None:
    with Store.open(settings) as store:
        for _ in range(USUAL_LIMIT):
            store.jobs.create("train", {}, subject="anna")
    assert len({job["id"] for job in client.get("/jobs")}) == USUAL_LIMIT + 3


def test_words_are_looked_for_in_names_and_facts(client: RestClient) -> None:
    assert names(client, text="FIST 3") == ["fist 3"]
    assert names(client, text="anna import") == EVERY
    for word in ("%", "_", "'", '"', "\\", "ö"):
        assert names(client, text=word) == []
    assert [job["kind"] for job in client.get("/jobs", {"text": "diagnose 0123"})] == ["diagnose"]


def test_what_is_no_part_is_refused(client: RestClient) -> None:
    for query in ({"limit": 0}, {"limit": 10**6}, {"offset": -1}, {"text": "a\nb"}):
        with pytest.raises(ServiceError):
            client.get("/takes", query)
