"""Long lists come in parts, each from where the last one ended; who asks for no part gets all of it."""

from __future__ import annotations

import sqlite3
from collections.abc import Callable
from contextlib import closing
from datetime import UTC, datetime
from typing import Any

import numpy as np
import pytest

from glovecal_client.errors import ServiceError
from glovecal_client.rest import RestClient
from glovecal_models.takes.take import Take
from glovecal_service.rest.http.list_part import USUAL_LIMIT
from glovecal_service.settings import Settings
from glovecal_service.store import Store
from glovecal_service.store.actor import Actor
from glovecal_service.store.list_part import ListPart

EVERY = [f"fist {number}" for number in range(7)]


def add_take(store: Store, number: int, name: str, subject: str = "anna", **facts: Any) -> str:
    readings = np.random.default_rng(number).uniform(0, 255, (5, 3))
    take = Take(name, "w", ("a", "b", "c"), np.arange(5) / 100, readings)
    return store.takes.add(take, subject=subject, layout="three", source="import", **facts).id


@pytest.fixture(autouse=True)
def rows(settings: Settings, client: RestClient) -> None:
    """Seven takes of anna and three jobs."""
    with Store.open(settings) as store:
        store.subjects.create("anna")
        for number, name in enumerate(EVERY):
            add_take(store, number, name)
        for kind in ("train", "diagnose", "train"):
            store.jobs.request_cancel(store.jobs.create(kind, {"model": "0123"}, subject="anna").id)


def names(client: RestClient, **query: object) -> list[str]:
    return [take["name"] for take in client.get("/takes", query)]


def walked(
    client: RestClient, path: str, between: Callable[[int], object] = lambda part: None, **query: object
) -> list[list[Any]]:
    """Rows of each part, and what happens ``between`` them."""
    parts, after = [], None
    while not parts or after is not None:
        part = client.part(path, {**query, "after": after})
        parts.append(part.rows)
        after = part.after
        between(len(parts))
    return parts


def test_parts_in_either_order_hold_every_row_once(client: RestClient) -> None:
    for reverse in (False, True):
        parts = walked(client, "/takes", limit=3, reverse=reverse)
        assert [len(part) for part in parts] == [3, 3, 1]
        found = [take["name"] for part in parts for take in part]
        assert found == (EVERY[::-1] if reverse else EVERY)


def test_rows_that_come_and_go_meanwhile_neither_hide_nor_repeat_others(
    settings: Settings, client: RestClient
) -> None:
    with Store.open(settings) as store:
        first = store.takes.list()

        def change(part: int) -> None:
            if part == 1:
                store.takes.remove(first[-1].id)
                store.takes.remove(first[-3].id)  # where the first part ended
                add_take(store, 100, "later")

        found = [
            take["name"] for part in walked(client, "/takes", change, limit=3, reverse=True) for take in part
        ]
    assert found == EVERY[::-1]


def test_equal_times_are_no_matter(settings: Settings, client: RestClient) -> None:
    with Store.open(settings) as store, store.database.engine.begin() as connection:
        connection.exec_driver_sql(
            "UPDATE jobs SET created_at = '2026-01-01 00:00:00.000000', row_sha256 = ''"
        )
    with pytest.raises(ServiceError):
        client.get("/jobs/none")
    assert [len(part) for part in walked(client, "/jobs", limit=1)] == [0, 0, 0], (
        "all are damaged, and passed"
    )
    assert len(client.warnings) == 3


def test_the_answer_says_what_comes_after_it(client: RestClient) -> None:
    answer = client._send("GET", "/takes", params={"limit": 5})
    assert answer.headers["X-Total-Count"] == "7"
    assert answer.links["next"]["url"].startswith("?limit=5&after=20")
    last = client._send("GET", "/takes" + answer.links["next"]["url"])
    assert "next" not in last.links
    assert [take["name"] for take in answer.json() + last.json()] == EVERY
    searched = client._send("GET", "/takes", params={"limit": 5, "text": "fist"})
    assert "X-Total-Count" not in searched.headers, "to count them all would be read"
    assert "&after=" in searched.links["next"]["url"]
    assert client._send("GET", "/takes", params={"text": "fist 3"}).headers["X-Total-Count"] == "1"


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


def test_filters_leave_no_part_short(settings: Settings, client: RestClient) -> None:
    """Of hands, layouts, states, kinds and times: a part is full while there are rows."""
    with Store.open(settings) as store:
        for number in range(6):
            hand = ("left", "right", "unknown")[number % 3]
            add_take(store, 50 + number, f"{hand} {number}", accounting={"hand": hand})
    whole = names(client, hand="left")
    assert whole == [*EVERY, "left 0", "unknown 2", "left 3", "unknown 5"]
    parts = walked(client, "/takes", limit=2, hand="left")
    assert [len(part) for part in parts] == [2, 2, 2, 2, 2, 1]
    assert [take["name"] for part in parts for take in part] == whole
    assert [len(part) for part in walked(client, "/jobs", limit=1, kind="train")] == [1, 1]
    assert client.part("/jobs", {"limit": 1, "state": "cancelled"}).total == 3
    assert client.get("/jobs", {"only_unfinished": True}) == []
    middle = client.get("/takes")[3]["created_at"]
    assert names(client, since=middle) == [*EVERY[3:], *names(client)[7:]]
    assert names(client, until=middle) == EVERY[:3]


def test_who_sees_some_people_pages_through_theirs_alone(settings: Settings, client: RestClient) -> None:
    """No part is short because of rows of others, and none of them is counted."""
    with Store.open(settings) as store:
        store.subjects.create("ben")
        for number in range(5):
            add_take(store, 60 + number, f"own {number}", "ben")
            add_take(store, 70 + number, f"other {number}")
            store.jobs.create("train", {}, subject="ben")
        seen = store.acting_as(Actor(name="ben", subjects=frozenset({"ben"})))
        for list_part in (seen.takes.page, seen.jobs.page):
            pages = [list_part(ListPart(limit=2))]
            while pages[-1].after is not None:
                pages.append(list_part(ListPart(limit=2, after=pages[-1].after)))
            assert [len(page.records) for page in pages] == [2, 2, 1]
            assert {page.total for page in pages} == {5}
            assert {record.subject for page in pages for record in page.records} == {"ben"}
        assert seen.takes.page(ListPart(limit=2), subject="anna").records == []
        assert [record.name for record in seen.subjects.page(ListPart(limit=1)).records] == ["ben"]
        assert seen.models.count_active() == 0


def test_a_damaged_row_stops_no_part(settings: Settings, client: RestClient) -> None:
    """Whichever row it is: also the last one of a part, where its very place in the list cannot be read."""
    ids = [take["id"] for take in client.get("/takes")]
    for number, column in ((2, "name"), (4, "created_at")):
        with closing(sqlite3.connect(settings.data / "glovecal.sqlite3")) as connection:
            connection.execute(f"UPDATE takes SET {column} = '2026 and so on' WHERE id = ?", (ids[number],))
            connection.commit()
    for limit in (1, 2, 3, 4, 7):
        client.warnings.clear()
        found = [take["id"] for part in walked(client, "/takes", limit=limit) for take in part]
        assert sorted(found) == sorted(set(ids) - {ids[2], ids[4]}), limit
        assert sorted(sentence.split("'")[1] for sentence in client.warnings) == sorted([ids[2], ids[4]])


def test_every_list_comes_in_parts(client: RestClient) -> None:
    """Whoever adds a list gives it ``Paging``."""
    paths = client.get("/openapi.json")["paths"]
    lists = []
    for path, operations in paths.items():
        answer = operations.get("get", {}).get("responses", {}).get("200", {}).get("content", {})
        if answer.get("application/json", {}).get("schema", {}).get("type") == "array":
            lists.append(path)
            known = {each["name"]: each["schema"] for each in operations["get"]["parameters"]}
            assert {"limit", "after"} <= set(known), path
            assert known["limit"]["default"] == USUAL_LIMIT, path
    assert {"/v1/takes", "/v1/models", "/v1/jobs", "/v1/subjects", "/v1/audit", "/v1/effects"} <= set(lists)


def test_lists_that_are_not_in_the_database_come_in_parts_too(client: RestClient) -> None:
    whole = [effect["name"] for effect in client.get("/effects")]
    parts = walked(client, "/effects", limit=4)
    assert [effect["name"] for part in parts for effect in part] == whole
    assert {len(part) for part in parts[:-1]} == {4}
    assert client.part("/effects", {"limit": 1}).total == len(whole)


def test_what_is_no_part_is_refused(client: RestClient) -> None:
    far = datetime(9999, 1, 1, tzinfo=UTC).isoformat()
    for query in (
        {"limit": 0}, {"limit": 10**6}, {"text": "a\nb"}, {"after": "nowhere"}, {"after": "~"},
        {"after": "20260101T000000.000000Z"}, {"since": "monday"}, {"since": far},
        {"since": "2026-01-01T00:00:00"},
    ):  # fmt: skip
        with pytest.raises(ServiceError) as refused:
            client.get("/takes", query)
        assert refused.value.status == 422, query
    with pytest.raises(ServiceError, match="nothing is called 'x' any more: begin again"):
        client.get("/effects", {"after": "x"})
