"""What the studio hears of gloves: states from any message, and nobody waits for a glove."""

from __future__ import annotations

import json
import time
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import zenoh
from realtime_support import eventually, free_endpoint

from glovecal_client.errors import NoAnswer, QueryRefused
from glovecal_client.keys import GloveKeys, service_alive_key
from glovecal_client.session import open_client, open_router
from glovecal_client.wire.pose import Pose, PoseFlag
from glovecal_service.rest.job.answer import JobRow
from glovecal_service.settings import Settings
from glovecal_service.studio.glove_state import SENTENCES, Word, glove_state
from glovecal_service.studio.live_feed import LiveFeeds
from glovecal_service.studio.shell import result_link

STREAMING = {"state": "streaming", "sentence": "", "rate_hz": 60.0}
POSE = Pose(7, 1, 0, 0, model_sha256="ab" * 32, degrees=np.zeros(2, np.float32), skipped=3, age_us=1500)


def flagged(*flags: PoseFlag) -> Pose:
    return replace(POSE, flags=sum(flags))


@pytest.mark.parametrize(
    ("word", "status", "is_silent", "pose", "is_stale"),
    [
        ("lost", STREAMING, True, POSE, False),
        ("lost", {"state": "lost"}, False, POSE, False),
        ("unwatched", STREAMING, False, None, False),
        ("uncalibrated", STREAMING, False, flagged(PoseFlag.UNCALIBRATED), False),
        ("stale", STREAMING, False, flagged(PoseFlag.STALE), True),
        ("faulty sensor", STREAMING, False, flagged(PoseFlag.FAULTY_SENSOR, PoseFlag.SETTLING), False),
        ("settling", STREAMING, False, flagged(PoseFlag.SETTLING), False),
        ("ok", STREAMING, False, POSE, False),
    ],
)
def test_each_state_has_its_word_and_sentence(
    word: Word, status: dict[str, Any], is_silent: bool, pose: Pose | None, is_stale: bool
) -> None:
    state = glove_state(status, is_silent, pose, is_stale)
    assert (state.word, state.sentence) == (word, SENTENCES[word])
    assert (state.age_ms is None) == (word in ("lost", "stale", "unwatched"))
    assert (state.rate_hz is None) == (word == "lost" or "rate_hz" not in status)


def test_why_it_is_uncalibrated_and_what_was_lost_comes_from_the_service() -> None:
    account = {"sentence": "nobody wears glove g", "missing": 4, "refused": {"damaged": 2, "not_finite": 1}}
    state = glove_state(STREAMING, False, flagged(PoseFlag.UNCALIBRATED), False, account)
    assert state.sentence == "Nobody wears glove g."
    assert (state.lost, state.refused, state.skipped) == (4, 3, 3)


def test_what_was_noticed_in_the_last_seconds_is_shown_first() -> None:
    warning = {"part": "wearer", "sentence": "The readings do not fit.", "advice": "Check who wears it."}
    state = glove_state(STREAMING, False, POSE, False, {"warnings": [warning], "sentence": ""})
    assert (state.word, state.sentence) == ("check", "The readings do not fit. Check who wears it.")
    state = glove_state(STREAMING, False, POSE, False, {"sentence": "wrong hand: r is a left glove"})
    assert (state.word, state.sentence) == ("check", "Wrong hand: r is a left glove.")
    assert glove_state(STREAMING, False, POSE, False, {"warnings": "junk"}).word == "ok"


@pytest.mark.parametrize("junk", [None, "60", [], {"a": 1}, float("nan"), True])
def test_numbers_that_are_none_are_not_shown(junk: Any) -> None:
    account = {"missing": junk, "refused": {"x": junk}, "sentence": junk}
    state = glove_state({**STREAMING, "rate_hz": junk, "sentence": junk}, False, POSE, False, account)
    assert (state.rate_hz, state.lost, state.refused) == (None, None, 0)


def test_a_glove_that_does_not_answer_holds_up_nobody() -> None:
    """Neither its own feed nor the states of others wait for its meta; a hostile status harms nobody."""
    settings = Settings(zenoh=free_endpoint())
    with open_router([settings.zenoh]), open_client([settings.zenoh], wait_s=20) as session:
        mute = [GloveKeys(settings.site, name) for name in ("mute-1", "mute-2")]
        unanswered: list[zenoh.Query] = []
        tokens = [session.liveliness().declare_token(keys.alive) for keys in mute]
        answerers = [session.declare_queryable(keys.meta, unanswered.append) for keys in mute]
        feeds = LiveFeeds(settings)
        eventually(lambda: feeds.states() == {}, "the session is there")
        for key in (*(keys.status for keys in mute), "glovecal/lab/<b>/status", "glovecal/lab/A/status"):
            session.put(key, json.dumps(STREAMING))
        eventually(lambda: list(feeds.states()) == ["mute-1", "mute-2"], "both are heard of")
        began = time.monotonic()
        opened = [feeds.open(name) for name in ("mute-1", "mute-2", "mute-2")]
        states = feeds.states()
        assert time.monotonic() - began < 0.8, "each would have waited a second"
        assert [state.word for state in states.values()] == ["unwatched", "unwatched"]
        assert opened[1] is opened[2]
        eventually(lambda: len(unanswered) == 2, "both were asked")
        query = next(query for query in unanswered if str(query.key_expr) == mute[0].meta)
        query.reply(mute[0].meta, json.dumps({"sensors": ["A", 5]}))
        for query in unanswered:
            query.drop()
        unanswered.clear()
        eventually(lambda: opened[0].sensors == ["A", "5"], "the answer arrives later")
        with pytest.raises(NoAnswer) as told:
            feeds.explain("mute-1", "I_PIP")
        assert not isinstance(told.value, QueryRefused)
        for feed in opened:
            feeds.release(feed)
        feeds.close()
        for each in (*answerers, *tokens):
            each.undeclare()


def test_a_status_that_nobody_stands_behind_changes_nothing() -> None:
    settings = Settings(zenoh=free_endpoint())
    keys = GloveKeys(settings.site, "right")
    service = service_alive_key(settings.site, "realtime-1").replace("/alive", "/status")

    def say(session: zenoh.Session, run_id: str, state: str, **more: Any) -> None:
        session.put(keys.status, json.dumps({**STREAMING, "run_id": run_id, "state": state, **more}))

    with open_router([settings.zenoh]), open_client([settings.zenoh], wait_s=20) as session:
        feeds = LiveFeeds(settings)
        eventually(lambda: feeds.states() == {}, "the session is there")
        for name in [f"invented-{number}" for number in range(300)]:
            session.put(GloveKeys(settings.site, name).status, json.dumps(STREAMING))
        say(session, "0b", "streaming")
        time.sleep(0.3)
        assert feeds.states() == {}
        token = session.liveliness().declare_token(keys.alive)
        say(session, "0a", "streaming", rate_hz=120.0)
        account = {"run_id": "0a", "missing": 0}
        session.put(service, json.dumps({"gloves": {"right": account}}))
        eventually(lambda: feeds.states().get("right"), "the glove")
        for number in range(50):
            say(session, f"{number:x}c", "stopped", sentence="stolen")
        eventually(lambda: len(feeds.states()) == 1, "heard")
        time.sleep(0.2)
        state = feeds.states()["right"]
        assert (state.word, state.rate_hz) == ("unwatched", 120.0)
        token.undeclare()
        eventually(lambda: feeds.states()["right"].word == "lost", "its capture is gone")
        for _ in range(3):
            say(session, "0a", "streaming", sentence="stolen")
            time.sleep(0.1)
        assert feeds.states()["right"].word == "lost"
        feeds.close()


@pytest.mark.parametrize(
    ("kind", "result", "address"),
    [
        ("train", None, None),
        ("train", {"model": "ab"}, "/fall?model=ab"),
        ("add_effect", {"model": "ab"}, "/fall?model=ab"),
        ("diagnose", {"model": "ab"}, "/diagnose?model=ab"),
        ("ceiling", {"model": "ab"}, "/compare?models=ab"),
        ("improve", {"steps": []}, "../v1/jobs/j1/report"),
        ("detectability", {"trials": []}, "../v1/jobs/j1/report"),
        ("remove_effect", {}, None),
    ],
)
def test_a_finished_job_leads_to_its_result(kind: str, result: Any, address: str | None) -> None:
    model = (result or {}).get("model")
    link = result_link(JobRow.model_construct(id="j1", kind=kind, has_result=bool(result), model=model))
    assert (link and link[1]) == address
