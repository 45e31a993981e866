"""Whose word on a glove counts: frames first, and the first word of a run."""

from __future__ import annotations

import json
import secrets
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from types import SimpleNamespace
from typing import Any

import pytest
import zenoh
from hypothesis import given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st
from realtime_support import (
    LAYOUT,
    WireGlove,
    eventually,
    free_endpoint,
    glove_status,
    part_of_service,
    store_model,
)

from glovecal_client.keys import GloveKeys
from glovecal_client.publishers import Publishers
from glovecal_client.run_metas import OF_A_RUN, RUNS_KEPT, RunMetas
from glovecal_client.session import ask_json, open_client, open_router
from glovecal_service.serve import real_time
from glovecal_service.settings import Settings
from glovecal_service.store import Store
from glovecal_service.store.errors import Conflict
from glovecal_service.store.gloves import MOST_GLOVES

WITHIN_S = 60.0


@pytest.fixture(scope="module")
def settings(tmp_path_factory: pytest.TempPathFactory) -> Settings:
    data = tmp_path_factory.mktemp("believed")
    settings = Settings(data=data, database=None, artifacts=None, zenoh=free_endpoint(), site="lab")
    Store.open(settings).close()
    return settings


@pytest.fixture(scope="module")
def session(settings: Settings) -> Iterator[zenoh.Session]:
    with part_of_service(real_time, settings), open_client([settings.zenoh], wait_s=20) as session:
        yield session


@pytest.fixture
def store(settings: Settings) -> Iterator[Store]:
    with Store.open(settings) as store:
        yield store


@contextmanager
def streaming(glove: WireGlove, rate_hz: float = 100.0) -> Iterator[None]:
    stopped = threading.Event()

    def send() -> None:
        while not stopped.wait(1.0 / rate_hz):
            glove.send()

    thread = threading.Thread(target=send)
    thread.start()
    try:
        yield
    finally:
        stopped.set()
        thread.join()


def names(store: Store) -> list[str]:
    return [record.name for record in store.gloves.list()]


def test_a_run_keeps_its_sensors_wearer_and_hand(
    session: zenoh.Session, settings: Settings, store: Store
) -> None:
    model = store_model(store, "anna", degrees_per_count=0.5)
    store_model(store, "mallory", degrees_per_count=5.0)
    glove = WireGlove(session, settings, "g-kept", subject="anna")
    with streaming(glove), open_client([settings.zenoh], wait_s=20) as stranger:
        glove.say_meta(hand="right")
        eventually(
            lambda: glove_status(session, settings, "g-kept").get("model") == model, "served", WITHIN_S
        )
        forged = {"run_id": f"{glove.run_id:016x}", "layout": LAYOUT.name, "subject": "anna", "hand": "right"}
        for lie in ({"sensors": LAYOUT.sensors[::-1]}, {"subject": "mallory"}, {"hand": "left"}):
            stranger.put(glove.keys.meta, json.dumps({**forged, "sensors": LAYOUT.sensors, **lie}))
        other_run = {**forged, "run_id": f"{secrets.randbits(64):016x}", "subject": "mallory"}
        stranger.put(glove.keys.meta, json.dumps(other_run))

        def told() -> dict[str, Any] | None:
            warnings = glove_status(session, settings, "g-kept")["warnings"]
            return next((one for one in warnings if one["part"] == "publisher"), None)

        def told_of_all() -> dict[str, Any] | None:
            warning = told()
            return warning if warning is not None and "3 times" in warning["sentence"] else None

        warning = eventually(told_of_all, "what was refused", WITHIN_S)
        assert "hand is left, not right" in warning["sentence"]
        assert "Stop the other publisher" in warning["advice"]
        said = ask_json(session, glove.keys.pose_meta)
        assert (said["subject"], said["hand"], said["model"]) == ("anna", "right", model)
        eventually(lambda: "g-kept" in names(store), "it is stored", WITHIN_S)
        assert store.gloves.get("g-kept").meta["sensors"] == list(LAYOUT.sensors)
    glove.restart()
    glove.say_meta(subject="mallory")
    eventually(lambda: ask_json(session, glove.keys.pose_meta)["subject"] == "mallory", "a new run", WITHIN_S)
    assert store.gloves.get("g-kept").subject == "anna"  # no frame of the new run has come
    with streaming(glove):
        eventually(lambda: store.gloves.get("g-kept").subject == "mallory", "its frames come", WITHIN_S)


def test_a_glove_is_stored_with_its_first_valid_frame(
    session: zenoh.Session, settings: Settings, store: Store
) -> None:
    invented = [GloveKeys(settings.site, f"invented-{number}") for number in range(400)]
    for keys in invented:
        session.put(keys.meta, json.dumps({"layout": LAYOUT.name, "run_id": "0b", "subject": "nobody"}))
    glove = WireGlove(session, settings, "g-first")
    glove.say_meta()
    glove.send_bytes(b"no frame")
    eventually(lambda: glove_status(session, settings, "g-first").get("received") == 1, "the junk", WITHIN_S)
    assert not [name for name in names(store) if name.startswith("invented") or name == "g-first"]
    glove.send()
    eventually(lambda: "g-first" in names(store), "stored", WITHIN_S)
    store.gloves.remove("g-first")
    glove.send()
    eventually(lambda: "g-first" in names(store), "stored again, as it streams", WITHIN_S)


def test_so_many_gloves_are_stored_and_one_that_is_too_much_is_told(
    session: zenoh.Session, settings: Settings, store: Store
) -> None:
    for number in range(MOST_GLOVES - len(names(store))):
        store.gloves.assign(f"filler-{number}", None)
    with pytest.raises(Conflict, match=r"256 gloves are stored, .* glovecal glove remove NAME"):
        store.gloves.assign("one-more", None)
    glove = WireGlove(session, settings, "g-late")
    glove.say_meta()
    glove.send()

    def sentence() -> str:
        return glove_status(session, settings, "g-late").get("sentence") or ""

    eventually(lambda: "glovecal glove remove NAME" in sentence(), "why it is not stored", WITHIN_S)
    store.gloves.remove("filler-0")
    eventually(lambda: "g-late" in names(store), "room for it", WITHIN_S)
    for name in [name for name in names(store) if name.startswith("filler")]:
        store.gloves.remove(name)


def test_a_status_is_believed_only_with_its_token_and_run(session: zenoh.Session, settings: Settings) -> None:
    keys = GloveKeys(settings.site, "g-forged")
    status = {"run_id": "0c", "sequence": 10, "state": "streaming"}
    for sequence in (10, 500):
        session.put(keys.status, json.dumps({**status, "sequence": sequence}))
        time.sleep(0.6)
    assert glove_status(session, settings, "g-forged") == {}
    glove = WireGlove(session, settings, "g-true")
    glove.send()
    glove.sequence += 30  # numbered, and never heard
    mine = {"run_id": f"{glove.run_id:016x}", "state": "streaming", "sequence": glove.sequence - 1}
    session.put(glove.keys.status, json.dumps(mine))

    def missing() -> int:
        return glove_status(session, settings, "g-true").get("missing", 0)

    eventually(lambda: missing() == 30, "what its capture says", WITHIN_S)
    with streaming(glove):
        until = time.monotonic() + 1.5
        while time.monotonic() < until:
            session.put(glove.keys.status, json.dumps({**status, "sequence": 900}))
            assert missing() == 30


def test_tokens_come_and_go_and_the_last_words_count() -> None:
    endpoint, keys = free_endpoint(), GloveKeys("lab", "g1")
    with open_router([endpoint]) as router:
        with open_client([endpoint], wait_s=20) as capture:
            token = capture.liveliness().declare_token(keys.alive)
            publishers = Publishers(router, keys.alive)
            eventually(lambda: publishers.has("g1"), "a token that was there before", WITHIN_S)
            assert not publishers.has("g2")
            token.undeclare()
        assert publishers.has("g1")  # for two seconds
        eventually(lambda: not publishers.has("g1"), "gone", WITHIN_S)
        publishers.close()


VALUES = st.one_of(
    st.none(), st.booleans(), st.integers(), st.text(max_size=5), st.lists(st.text(max_size=3), max_size=3)
)
DOCUMENTS = st.dictionaries(st.sampled_from((*OF_A_RUN, "run_id", "log_to")), VALUES, max_size=6)


@hypothesis_settings(max_examples=200, deadline=None)
@given(st.lists(DOCUMENTS, max_size=12))
def test_whatever_is_said_a_run_never_changes_its_mind(documents: list[dict[str, Any]]) -> None:
    metas, said = RunMetas(), SimpleNamespace(refused=0)
    for document in documents:
        run_id = str(document.get("run_id") or "")
        before = metas.of(run_id)
        taken = metas.note(document, keep=run_id)
        said.refused += not taken
        after = metas.of(run_id)
        assert after is not None
        for name in OF_A_RUN:
            if before is not None and before.get(name) not in (None, "unknown", []):
                assert after[name] == before[name]
    assert metas.refused == said.refused
    assert bool(metas.sentence) == bool(said.refused)
    assert sum(metas.of(str(each.get("run_id") or "")) is not None for each in documents) <= len(documents)
    assert len({id(metas.of(str(n.get("run_id") or ""))) for n in documents} - {id(None)}) <= RUNS_KEPT
