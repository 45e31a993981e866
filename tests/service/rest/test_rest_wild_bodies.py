"""The law of every route: whatever is sent, no answer is 500, and a refusal is a sentence of ours that names
the thing and what would be right. The routes are taken from the published description."""

from __future__ import annotations

import copy
import json
from collections.abc import Iterator
from contextlib import ExitStack
from typing import Any

import pytest
import zenoh
from free_ports import free_endpoint
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from lawful_answers import require_lawful
from stored_service import StoredService, stored_service
from wild_requests import (
    WILD_JSON,
    WILD_QUERIES,
    WILD_TEXTS,
    Operation,
    Samples,
    operations,
    places,
    wild_archives,
    wild_files,
    with_wild,
)

from glovecal_client.session import router_config
from glovecal_service.rest.app import create_app
from glovecal_service.settings import Settings

DOCUMENT = create_app(Settings()).openapi()
ENDLESS = ("/v1/jobs/{id}/events", "/v1/sampling/{id}/events")
OPERATIONS = [each for each in operations(DOCUMENT) if each.path not in ENDLESS]
WILD = settings(
    max_examples=8,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)  # fmt: skip


@pytest.fixture(scope="module")
def stored(tmp_path_factory: pytest.TempPathFactory) -> Iterator[StoredService]:
    """Beside a router at which strangers answer for gloves, cameras and real time."""
    with ExitStack() as stack:
        endpoint = free_endpoint()
        router = stack.enter_context(zenoh.open(router_config((endpoint,))))
        for key, said in strangers().items():
            stack.enter_context(_answering(router, key, said))
        yield stack.enter_context(stored_service(tmp_path_factory.mktemp("stored"), endpoint))


@pytest.fixture(scope="module")
def samples(stored: StoredService) -> Samples:
    return Samples(DOCUMENT, stored.known)


def strangers() -> dict[str, bytes]:
    """What anyone in the network may say on keys of ours."""
    wild = {"sentence": 7, "state": [], "warnings": 3, "model": {}, "subject": 1e308}
    fine = {"state": "calibrated"}
    camera = {"camera": {"rotations": [None], "pictures": 10**400}, "state": "streaming", "sentence": "x"}
    said: dict[str, Any] = {
        "glovecal/lab/service/a/status": {"gloves": [1, 2]},
        "glovecal/lab/service/b/status": {"gloves": {"left": None, "$x$": wild, "ok": fine}},
        "glovecal/lab/service/c/status": {"gloves": {"left": {"warnings": [wild], "sentence": "\ud800"}}},
        "glovecal/lab/UPPER/status": {"started_wall_ns": 1, "wall_ns": 2},
        "glovecal/lab/left/status": {"started_wall_ns": 1, "wall_ns": 10**400, **camera},
        "glovecal/lab/other/status": {"started_wall_ns": True, "wall_ns": None, "camera": {"health": "NaN"}},
    }  # fmt: skip
    texts = {key: json.dumps(value).encode() for key, value in said.items()}
    deep = b'{"gloves":' * 5000
    return texts | {"glovecal/lab/service/d/status": deep, "glovecal/lab/deep/status": deep}


def _answering(session: zenoh.Session, key: str, said: bytes) -> Any:
    def answer(query: zenoh.Query) -> None:
        with query:
            query.reply(key, said)

    return session.declare_queryable(key, answer)


@pytest.mark.parametrize("operation", OPERATIONS, ids=str)
@WILD
@given(data=st.data())
def test_whatever_is_sent(
    operation: Operation, stored: StoredService, samples: Samples, data: st.DataObject
) -> None:
    query = {item["name"]: stored.known.get(item["name"]) for item in operation.parameters}
    sent: dict[str, Any] = {"params": {name: value for name, value in query.items() if value is not None}}
    kinds = [*(["query"] if operation.query else []), *operation.media_types]
    kind = data.draw(st.sampled_from(kinds or ["nothing"]), "what goes wild")
    if kind == "query":
        name = data.draw(st.sampled_from(operation.query))
        sent["params"] |= {name: data.draw(st.sampled_from(WILD_QUERIES))}
    if operation.body is not None and kind in ("query", "application/json"):
        right = samples.value(operation.body, choose=lambda values: data.draw(st.sampled_from(values)))
        sent["json"] = right
        if kind == "application/json":
            place = data.draw(st.sampled_from(list(places(right))), "place")
            texts = [json.dumps(text) for text in WILD_TEXTS]
            wild = data.draw(
                st.sampled_from(texts if place and place[-1] == "text" else [*WILD_JSON, *texts])
            )
            if place and place[-1] == "upload":
                wild = json.dumps(_uploaded(stored, data.draw(wild_files([*stored.files.values()]))))
            del sent["json"]
            sent |= {"content": with_wild(right, place, wild), "headers": {"Content-Type": kind}}
    elif kind not in ("query", "nothing"):
        content = data.draw(wild_files([*stored.files.values()]))
        sent |= {"content": content, "headers": {"Content-Type": kind}}
    require_lawful(operation, stored.http.request(operation.method, samples.path(operation)[3:], **sent))


@pytest.mark.parametrize(
    "operation", [each for each in OPERATIONS if each.takes_upload], ids=str
)  # fmt: skip
def test_archives_that_cannot_be_read(operation: Operation, stored: StoredService, samples: Samples) -> None:
    """Encrypted, packed by an unknown method, with a wrong checksum, bombs, and what is no archive."""
    for content in wild_archives():
        body = copy.deepcopy(samples.value(operation.body or {}))
        body.get("body", body)["upload"] = _uploaded(stored, content)
        answer = stored.http.request(operation.method, samples.path(operation)[3:], json=body)
        require_lawful(operation, answer)
        assert answer.status_code >= 400


def test_strangers_who_answer_for_others_are_left_out(stored: StoredService) -> None:
    gloves = {each["glove"]: each for each in stored.http.get("/live-gloves").json()}
    assert gloves["ok"]["state"] == "calibrated"
    assert "$x$" not in gloves
    assert stored.http.get("/cameras").json() == []


def _uploaded(stored: StoredService, content: bytes) -> str:
    kind = {"Content-Type": "application/octet-stream"}
    return stored.http.post("/uploads", content=content, headers=kind).json()["sha256"]
