"""Left and right CyberGlove III, emulated, in one process: commands, recordings, clocks kept with takes."""

from __future__ import annotations

import sys
import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest
import zenoh
from realtime_support import eventually
from recorder_support import recording_thread

from glovecal_client.capture.command import run_capture
from glovecal_client.capture.daemon import CaptureSettings
from glovecal_client.errors import NoAnswer, QueryRefused
from glovecal_client.keys import GloveKeys
from glovecal_client.session import ask_json, open_client, open_router
from glovecal_service.emulators.cyberglove3 import EmulatedCyberGlove3
from glovecal_service.emulators.glove import Faults
from glovecal_service.emulators.hand import MovingHand
from glovecal_service.emulators.ports import Emulation
from glovecal_service.emulators.pseudo_terminal import PseudoTerminal
from glovecal_service.rest.in_process import in_process_client
from glovecal_service.rest.take.hands import hand_alignment
from glovecal_service.settings import Settings
from glovecal_service.store import Store

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="pseudo-terminals are a POSIX thing")
DRIFT = {"left": 4e-3, "right": -4e-3}
"""Far from any quartz, so that seconds show it; an hour with 50 ppm is in tests/client/test_own_clock.py."""


@contextmanager
def two_gloves(settings: Settings, folder: Path) -> Iterator[dict[str, EmulatedCyberGlove3]]:
    """Both on pseudo-terminals, captured by this process."""
    gloves, stop = {}, threading.Event()
    with ExitStack() as opened:
        threads = []
        for hand, drift in DRIFT.items():
            faults = Faults()
            faults.drift, faults.offset_s = drift, 1.3
            glove = gloves[hand] = EmulatedCyberGlove3(MovingHand(3), faults)
            port = PseudoTerminal(folder / f"emulated-{hand}")
            opened.enter_context(Emulation(glove, port, faults))
            options = {"hand": hand, "clock": "glove"}
            asked = CaptureSettings(
                GloveKeys(settings.site, hand), f"anna-{hand}", "monday", (settings.zenoh,), folder / hand
            )
            capture = threading.Thread(
                target=run_capture,
                args=(f"cyberglove3:{port.name}", asked, options),
                kwargs={"stop": stop},
            )
            capture.start()
            threads.append(capture)
        try:
            yield gloves
        finally:
            stop.set()
            for capture in threads:
                capture.join(60)


def test_clocks_are_measured_told_and_kept_with_the_takes(
    settings: Settings, store: Store, tmp_path: Path
) -> None:
    with (
        open_router([settings.zenoh]),
        recording_thread(settings),
        open_client([settings.zenoh], wait_s=20) as session,
        two_gloves(settings, tmp_path) as gloves,
    ):
        keys = {hand: GloveKeys(settings.site, hand) for hand in gloves}
        for hand in gloves:
            eventually(lambda hand=hand: streams(session, keys[hand].status), f"the {hand} glove streams")
            meta = ask_json(session, keys[hand].meta)
            store.gloves.seen(hand, meta)
            set_once = ask_json(session, f"{keys[hand].control}?do=set-clock", timeout_s=120)
            assert abs(set_once["clock"]["ahead_s"]) <= 1 / 30
            told = ask_json(session, f"{keys[hand].control}?do=status", timeout_s=120)
            assert told["battery_v"] == pytest.approx(7.445)
            assert told["files"] == []
            started = ask_json(session, f"{keys[hand].control}?do=start;with=MONDAY.DAT", timeout_s=120)
            assert started["active_file"] == "MONDAY.DAT"
            with pytest.raises(QueryRefused, match="records on its card"):
                ask_json(session, f"{keys[hand].control}?do=status", timeout_s=120)
            with pytest.raises(QueryRefused, match="no command 'format'"):
                ask_json(session, f"{keys[hand].control}?do=format", timeout_s=120)
        with in_process_client(settings) as rest:

            def refused() -> bool:
                """Not yet where a glove is just being opened again, as happens on a busy computer."""
                answers = rest.post("/glove-commands", {"gloves": ["left", "right"]})["answers"]
                sentence = "the glove records on its card: stop that before 'status'"
                return [item["problem"] for item in answers] == [sentence] * 2

            eventually(refused, "both gloves answer that they record on their card")
        asked = {hand: store.recordings.request(hand, name="both") for hand in gloves}
        for one in asked.values():
            recorded = lambda one=one: store.recordings.get(one.id).facts.get("recorded", 0)  # noqa: E731
            eventually(lambda recorded=recorded: recorded() >= 90 * 9, "nine seconds of frames")
        for one in asked.values():
            store.recordings.stop(one.id)
        with in_process_client(settings) as rest:
            found = rest.post("/glove-commands", {"gloves": ["left", "right"], "do": "stop"})
            answers = found["answers"]
            assert "standard deviation" in found["sentences"][-1]
        for hand, item in zip(["left", "right"], answers, strict=True):
            stopped = item["answer"]
            assert stopped["files"] == ["MONDAY.DAT"]
            assert len(gloves[hand].card["MONDAY.DAT"]) > 61 * 90 * 5
        for one in asked.values():
            eventually(lambda one=one: not store.recordings.get(one.id).is_open, "the end of the recording")
        takes = {hand: store.recordings.get(one.id).facts["take"] for hand, one in asked.items()}
    for hand, take in takes.items():
        accounting = store.takes.get(take).accounting
        assert accounting is not None
        assert accounting["own_clock"]["drift_ppm"] == pytest.approx(1e6 * DRIFT[hand], abs=400)
    found, clocks = hand_alignment(store, takes["right"], takes["left"], claps=False)
    assert (found.how, found.shift_s) == ("one computer", 0)
    assert found.sd_s < 0.005
    assert clocks[0].computer is not None


def streams(session: zenoh.Session, key: str) -> bool:
    try:
        return ask_json(session, key)["state"] == "streaming"
    except NoAnswer:
        return False
