"""A sampling in the recorder process, when the user acts in the middle of what it does."""

from __future__ import annotations

import time
from pathlib import Path
from threading import Event

import pytest
from realtime_support import LAYOUT
from recorder_support import GLOVE, recorder_settings, store_with_glove

from glovecal_client.keys import GloveKeys
from glovecal_client.session import open_router
from glovecal_models.sampling.catalogue import make_protocol
from glovecal_models.sampling.engine import Sampling, begin_sampling
from glovecal_models.sampling.state import SamplingState
from glovecal_service.incoming.glove_owners import GloveOwners
from glovecal_service.recorder.sampling_runner import LiveSampling, SamplingRunner
from glovecal_service.store import Store

ENDED = Event()
ENDED.set()


def goes_on(store: Store, id: str) -> None:
    """The user's go, as the web process keeps it."""
    record = store.samplings.get(id)
    sampling = Sampling(SamplingState.from_document(record.document))
    sampling.event(0.0, "go")
    assert store.samplings.save(record, sampling.state.to_document())


def test_a_go_while_the_recording_is_asked_for_is_not_lost(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    settings = recorder_settings(tmp_path)
    with store_with_glove(settings) as store, open_router([settings.zenoh]) as session:
        store.subjects.create("anna")
        state = begin_sampling(make_protocol("fk_only", LAYOUT), LAYOUT.sensors)
        record = store.samplings.create(
            glove=GLOVE, subject="anna", wearing="", layout=LAYOUT.name, document=state.to_document()
        )
        live = LiveSampling(session, GloveKeys(settings.site, GLOVE), record, LAYOUT, clock=lambda: 0.0)
        request = store.recordings.request

        def meanwhile(*arguments, **options):
            goes_on(store, record.id)
            return request(*arguments, **options)

        monkeypatch.setattr(store.recordings, "request", meanwhile)
        live.look(store)
        assert live.state.phase == "countdown"
        live.close()


def test_a_sampling_that_fails_is_closed_with_the_reason_and_the_next_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    settings = recorder_settings(tmp_path)
    with store_with_glove(settings) as store, open_router([settings.zenoh]) as session:
        store.subjects.create("anna")
        store.layouts.put(LAYOUT)
        state = begin_sampling(make_protocol("fk_only", LAYOUT), LAYOUT.sensors)
        made = {"glove": GLOVE, "subject": "anna", "wearing": "", "layout": LAYOUT.name}
        first = store.samplings.create(**made, document=state.to_document())
        owners = GloveOwners(session, settings.site, "recorder-1")
        runner = SamplingRunner(session, settings, lambda: Store.open(settings), owners)
        with monkeypatch.context() as broken:
            broken.setattr(LiveSampling, "look", lambda self, store: 1 // 0)
            runner.look()
        failed = store.samplings.get(first.id)
        assert not failed.open
        assert (
            failed.problem == "an error in Glovecal itself (ZeroDivisionError): the service's log tells where"
        )
        second = store.samplings.create(**made, document=state.to_document())
        runner.look()
        time.sleep(0.2)  # the store is followed ten times a second
        runner.look()
        assert store.samplings.get(second.id).recordings
        runner.run(ENDED)
