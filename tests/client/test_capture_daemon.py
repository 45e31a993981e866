"""The capture daemon with a real router: logs, publishes, answers, loses and finds its device."""

from __future__ import annotations

import json
import re
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
import zenoh
from loopback import eventually, free_endpoint, heard_of
from signal_generator import SignalGenerator, values_of

from glovecal_client import (
    CaptureRefused,
    DeviceError,
    Frame,
    GloveKeys,
    NoAnswer,
    Recording,
    decode_frame,
    fetch_frames,
    open_client,
    open_router,
)
from glovecal_client.capture.daemon import CaptureDaemon, CaptureSettings, CaptureSummary
from glovecal_client.capture.device import Reading
from glovecal_client.capture.stream.parser import Counters
from glovecal_client.session import ask, ask_json

KEYS = GloveKeys("lab", "g1")


class RunningCapture:
    """A daemon in a thread."""

    def __init__(
        self, device: SignalGenerator, endpoint: str, data: Path, subject: str | None = None
    ) -> None:
        self.sentences: list[str] = []
        self.summary: CaptureSummary | None = None
        self.error: BaseException | None = None
        settings = CaptureSettings(KEYS, subject=subject, endpoints=(endpoint,), data=data)
        self._daemon = CaptureDaemon(device, settings, self.sentences.append)
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def _run(self) -> None:
        try:
            self.summary = self._daemon.run(self._stop)
        except BaseException as error:
            self.error = error

    @property
    def ended(self) -> bool:
        return not self._thread.is_alive()

    def finish(self) -> CaptureSummary:
        self._stop.set()
        self._thread.join(120)
        assert self.error is None, self.error
        assert self.summary is not None
        return self.summary

    def fail(self) -> BaseException:
        self._thread.join(120)
        assert self.error is not None
        return self.error


@contextmanager
def capturing(
    device: SignalGenerator, endpoint: str, data: Path, subject: str | None = None
) -> Iterator[RunningCapture]:
    running = RunningCapture(device, endpoint, data, subject)
    try:
        yield running
    finally:
        running._stop.set()
        running._thread.join(120)


class Wire:
    """A router, and what was heard on it about the glove."""

    def __init__(self, session: zenoh.Session, endpoint: str) -> None:
        self.session = session
        self.endpoint = endpoint
        self.frames: list[Frame] = []
        self.statuses: list[dict] = []
        self.metas: list[dict] = []
        self._subscribers = [
            session.declare_subscriber(KEYS.raw, self._hear_frame),
            session.declare_subscriber(KEYS.status, lambda s: self.statuses.append(as_json(s))),
            session.declare_subscriber(KEYS.meta, lambda s: self.metas.append(as_json(s))),
        ]

    def _hear_frame(self, sample: zenoh.Sample) -> None:
        assert str(sample.encoding) == "application/octet-stream;glovecal.frame.v1"
        self.frames.append(decode_frame(sample.payload.to_bytes()))


def as_json(sample: zenoh.Sample) -> dict:
    return json.loads(sample.payload.to_bytes())


@pytest.fixture
def wire() -> Iterator[Wire]:
    endpoint = free_endpoint()
    with open_router([endpoint]) as router:
        yield Wire(router, endpoint)


def logged(path: Path) -> list[Frame]:
    return list(Recording.open(path).frames())


def test_frames_are_logged_published_and_described(wire: Wire, tmp_path: Path) -> None:
    device = SignalGenerator()
    with capturing(device, wire.endpoint, tmp_path, subject="ada") as capture:
        eventually(lambda: len(wire.frames) >= 60, "60 frames")
        meta = ask_json(wire.session, KEYS.meta)
        status = ask_json(wire.session, KEYS.status)
        summary = capture.finish()
    final = eventually(
        lambda: next((s for s in wire.statuses if s["state"] == "stopped"), None), "the final status"
    )
    frames, heard = logged(summary.log), list(wire.frames)
    assert [frame.sequence for frame in frames] == list(range(summary.frames))
    assert [(f.sequence, f.monotonic_ns) for f in heard_of(frames, heard)] == [
        (f.sequence, f.monotonic_ns) for f in heard
    ]
    assert {frame.run_id for frame in heard} == {summary.run_id}
    for frame in heard:
        np.testing.assert_array_equal(frame.readings, values_of(frame.sequence))
        assert np.isnan(frame.context).all()
        assert frame.button == (frame.sequence % 2 == 1)
        assert frame.simulated
    run_id = f"{summary.run_id:016x}"
    assert (final["sequence"], final["frames"], final["run_id"]) == (
        summary.frames - 1,
        summary.frames,
        run_id,
    )
    assert (status["state"], status["disk"], status["bad_frames"]) == ("streaming", "ok", 0)
    assert 0 < status["rate_hz"] < 300
    expected = {"glove": "g1", "layout": "four-sensors", "sensors": ["A", "B", "C", "D"], "subject": "ada"}
    assert meta.items() >= (expected | {"simulated": True, "hand": "unknown", "run_id": run_id}).items()
    assert meta["log_from"] == 0
    assert meta["log_to"] >= 50
    assert wire.metas[0]["run_id"] == run_id
    assert Recording.open(summary.log).meta["device"] == "signal-generator"


def test_alive_token_comes_and_goes(wire: Wire, tmp_path: Path) -> None:
    def tokens() -> list[str]:
        return [str(reply.ok.key_expr) for reply in wire.session.liveliness().get(KEYS.alive) if reply.ok]

    with capturing(SignalGenerator(), wire.endpoint, tmp_path) as capture:
        eventually(lambda: tokens() == [KEYS.alive], "the token is there")
        capture.finish()
    eventually(lambda: tokens() == [], "the token is gone")


def test_bad_readings_are_counted_and_never_published(wire: Wire, tmp_path: Path) -> None:
    device = SignalGenerator()
    with capturing(device, wire.endpoint, tmp_path) as capture:
        eventually(lambda: len(wire.frames) > 5, "frames")
        values = np.array([[0, np.nan, 0, 0], [0, 0, np.inf, 0], [0, 0, 5000, 0]], np.float32)
        same: list[Reading] = []
        device.instead += [
            lambda: device.reading(0, values=np.zeros(3, np.float32)),
            *(lambda row=row: device.reading(0, values=row) for row in values),
            lambda: device.reading(0, monotonic_ns=1),
            lambda: same.append(device.reading(0)) or same[0],
            lambda: same[0],
            lambda: same[0],
        ]
        eventually(lambda: any("refused" in s["sentence"] for s in wire.statuses), "the refusal is told")
        eventually(lambda: "refused" not in wire.statuses[-1]["sentence"], "it is not told for ever")
        summary = capture.finish()
    assert (summary.bad_frames, summary.duplicates) == (5, 2)
    frames = logged(summary.log)
    assert [frame.sequence for frame in frames] == list(range(summary.frames))
    times = np.array([frame.monotonic_ns for frame in frames])
    assert (np.diff(times) > 0).all()
    assert all(frame.readings.max() <= 127 for frame in frames)
    assert any("refused" in sentence for sentence in capture.sentences)


def test_a_line_that_the_driver_refused_is_shown_and_not_too_often(wire: Wire, tmp_path: Path) -> None:
    device = SignalGenerator()
    device.counters = Counters()  # type: ignore[attr-defined]
    with capturing(device, wire.endpoint, tmp_path) as running:
        for _ in range(3):
            device.counters.refuse(b"1,nan", "B is 'nan', not a number")  # type: ignore[attr-defined]
        shown = "'1,nan': B is 'nan', not a number"
        eventually(lambda: wire.statuses and wire.statuses[-1]["last_damaged"] == shown, "the line is shown")
        assert wire.statuses[-1]["damaged_frames"] == 3
        device.counters.refuse(b"1,nan", "B is 'nan', not a number")  # type: ignore[attr-defined]
        eventually(lambda: wire.statuses[-1]["damaged_frames"] == 4, "one more is counted")
        assert running.sentences.count(f"line refused: {shown} (3 refused so far)") == 1
        assert not any("4 refused" in sentence for sentence in running.sentences)


def test_device_unplugged_and_plugged_in_again(wire: Wire, tmp_path: Path) -> None:
    device = SignalGenerator()
    with capturing(device, wire.endpoint, tmp_path) as capture:
        eventually(lambda: len(wire.frames) > 5, "frames")
        device.unplugged.set()
        lost = eventually(lambda: next((s for s in wire.statuses if s["state"] == "lost"), None), "lost")
        assert "unplugged" in lost["sentence"]
        before = len(wire.frames)
        device.unplugged.clear()
        eventually(lambda: len(wire.frames) > before + 5, "frames again")
        summary = capture.finish()
    assert summary.reconnects == 1
    assert [frame.sequence for frame in logged(summary.log)] == list(range(summary.frames))
    assert {frame.run_id for frame in wire.frames} == {summary.run_id}


def test_device_that_is_not_there_yet_is_waited_for(wire: Wire, tmp_path: Path) -> None:
    device = SignalGenerator()
    device.unplugged.set()
    with capturing(device, wire.endpoint, tmp_path) as capture:
        eventually(lambda: any(s["state"] == "lost" for s in wire.statuses), "it is missed")
        device.unplugged.clear()
        eventually(lambda: len(wire.frames) > 5, "frames")
        assert capture.finish().reconnects == 0


def test_device_that_is_open_but_silent_is_told(wire: Wire, tmp_path: Path) -> None:
    with capturing(SignalGenerator(silent_after=5), wire.endpoint, tmp_path):
        silent = re.compile("no reading for [0-9]+ s")
        eventually(lambda: any(silent.search(s["sentence"]) for s in wire.statuses), "silence is told")
        assert wire.statuses[-1]["state"] == "streaming"
        assert wire.statuses[-1]["rate_hz"] == 0.0


def test_device_that_cannot_work_ends_the_capture_with_its_sentence(wire: Wire, tmp_path: Path) -> None:
    device = SignalGenerator()
    device.instead.append(DeviceError("no glove speaks at this baud rate"))
    with capturing(device, wire.endpoint, tmp_path) as capture:
        assert "baud rate" in str(capture.fail())


def test_device_that_comes_to_its_end_stops_the_capture_cleanly(wire: Wire, tmp_path: Path) -> None:
    with capturing(SignalGenerator(rate_hz=2000, frames=100), wire.endpoint, tmp_path) as capture:
        eventually(lambda: capture.ended, "the capture ends by itself")
        assert capture.finish().frames == 100
    eventually(lambda: wire.statuses and wire.statuses[-1]["state"] == "stopped", "the final status")
    assert wire.statuses[-1]["sequence"] == 99


def test_missed_frames_are_fetched_from_the_log(wire: Wire, tmp_path: Path) -> None:
    device = SignalGenerator(rate_hz=5000, silent_after=9000)
    with capturing(device, wire.endpoint, tmp_path) as capture:
        eventually(lambda: wire.statuses and wire.statuses[-1]["frames"] == 9000, "9000 frames are taken")
        run_id = wire.frames[0].run_id
        frames = fetch_frames(wire.session, "lab", "g1", run_id, 10, 8999)
        assert [frame.sequence for frame in frames] == list(range(10, 9000))
        assert all(frame.repaired for frame in frames)
        np.testing.assert_array_equal(frames[5].readings, values_of(15))
        assert [f.sequence for f in fetch_frames(wire.session, "lab", "g1", run_id, 7, 7)] == [7]
        with pytest.raises(NoAnswer, match="no frames 10000000"):
            fetch_frames(wire.session, "lab", "g1", run_id, 10_000_000, 10_000_001)
        with pytest.raises(NoAnswer, match="was not recorded here"):
            fetch_frames(wire.session, "lab", "g1", run_id ^ 1, 0, 5)
        capture.finish()
    with pytest.raises(NoAnswer, match="nobody answered"):
        fetch_frames(wire.session, "lab", "g1", run_id, 0, 5, timeout_s=1)


@pytest.mark.parametrize("question", ["", "run=1", "run=zz;from=0;to=1", "from=0;to=1", "a" * 10_000])
def test_bad_log_questions_are_answered_with_a_sentence(wire: Wire, tmp_path: Path, question: str) -> None:
    with capturing(SignalGenerator(), wire.endpoint, tmp_path):
        eventually(lambda: len(wire.frames) > 2, "frames")
        with pytest.raises(NoAnswer, match="is not run=HEX16;from=A;to=B"):
            ask(wire.session, f"{KEYS.log}?{question}")


def test_frames_of_an_earlier_run_can_still_be_fetched(wire: Wire, tmp_path: Path) -> None:
    with capturing(SignalGenerator(rate_hz=1000, frames=50), wire.endpoint, tmp_path) as capture:
        earlier = eventually(lambda: capture.summary, "the first run ends")
    with capturing(SignalGenerator(), wire.endpoint, tmp_path):
        eventually(lambda: len(wire.frames) > earlier.frames, "frames of the second run")
        frames = fetch_frames(wire.session, "lab", "g1", earlier.run_id, 0, 49)
    assert [frame.sequence for frame in frames] == list(range(50))


def test_second_publisher_of_a_glove_is_refused_by_name(wire: Wire, tmp_path: Path) -> None:
    with capturing(SignalGenerator(), wire.endpoint, tmp_path / "a") as first:
        eventually(lambda: len(wire.frames) > 5, "frames")
        with capturing(SignalGenerator(), wire.endpoint, tmp_path / "b") as second:
            error = second.fail()
        summary = first.finish()
    assert isinstance(error, CaptureRefused)
    assert f"'g1' at site 'lab' is already published by run {summary.run_id:016x}" in str(error)
    assert "signal-generator" in str(error)
    assert {frame.run_id for frame in wire.frames} == {summary.run_id}


def test_second_capture_into_the_same_folder_is_refused(wire: Wire, tmp_path: Path) -> None:
    with capturing(SignalGenerator(), wire.endpoint, tmp_path):
        eventually(lambda: len(wire.frames) > 5, "frames")
        with capturing(SignalGenerator(), free_endpoint(), tmp_path) as second:
            assert "another capture on this computer" in str(second.fail())


def test_of_two_captures_that_met_only_when_the_router_came_one_gives_way(tmp_path: Path) -> None:
    """It goes on recording, says why it does not publish, and publishes once the other is gone."""
    endpoint = free_endpoint()
    with (
        capturing(SignalGenerator(), endpoint, tmp_path / "a") as first,
        capturing(SignalGenerator(), endpoint, tmp_path / "b") as second,
    ):
        eventually(lambda: first.sentences and second.sentences, "both record without a router")
        with open_router([endpoint]) as router:

            def gave_way(one: RunningCapture) -> bool:
                return any("is already published by run" in sentence for sentence in one.sentences)

            eventually(lambda: gave_way(first) or gave_way(second), "one gives way")
            loser, winner = (first, second) if gave_way(first) else (second, first)
            wire = Wire(router, endpoint)
            eventually(lambda: len(wire.frames) > 5, "frames of the other")
            assert not loser.ended
            won = winner.finish()
            eventually(lambda: wire.frames[-1].run_id != won.run_id, "frames of the one that gave way")
            lost = loser.finish()
    assert {frame.run_id for frame in wire.frames} == {won.run_id, lost.run_id}
    assert [frame.sequence for frame in logged(lost.log)] == list(range(lost.frames))
    assert lost.frames_not_logged == 0


def test_a_status_that_nobody_stands_behind_ends_nothing(wire: Wire, tmp_path: Path) -> None:
    """A stranger's word, or one of a capture that is gone: publishing pauses to look, and that once."""
    with capturing(SignalGenerator(), wire.endpoint, tmp_path) as running:
        eventually(lambda: len(wire.frames) > 5, "frames")
        claim = {"run_id": f"{7:016x}", "started_wall_ns": 0, "state": "streaming", "device": "nothing"}
        wire.session.put(KEYS.status, json.dumps(claim))
        published = f"publishing to {KEYS.raw}"
        eventually(lambda: running.sentences.count(published) == 2, "it publishes again")
        before = len(wire.frames)
        wire.session.put(KEYS.status, json.dumps(claim))
        eventually(lambda: len(wire.frames) > before + 20, "frames afterwards")
        assert running.sentences.count(published) == 2
        assert any("is already published by run" in sentence for sentence in running.sentences)
        summary = running.finish()
    assert [frame.sequence for frame in logged(summary.log)] == list(range(summary.frames))


def test_recording_starts_without_a_router_and_publishing_when_it_comes(tmp_path: Path) -> None:
    endpoint = free_endpoint()
    with capturing(SignalGenerator(), endpoint, tmp_path) as capture:
        eventually(lambda: any("without publishing" in s for s in capture.sentences), "it says so")
        with open_router([endpoint]) as router:
            wire = Wire(router, endpoint)
            eventually(lambda: len(wire.frames) > 5, "frames")
            first = wire.frames[0].sequence
            early = fetch_frames(router, "lab", "g1", wire.frames[0].run_id, 0, first)
            assert [frame.sequence for frame in early] == list(range(first + 1))
            assert capture.finish().frames > first > 0


def test_router_restart_costs_no_recorded_frame_and_everything_works_again(tmp_path: Path) -> None:
    endpoint = free_endpoint()
    with capturing(SignalGenerator(), endpoint, tmp_path) as capture:
        with open_router([endpoint]) as router:
            before = Wire(router, endpoint)
            eventually(lambda: len(before.frames) > 5, "frames")
        with open_router([endpoint]) as router:
            after = Wire(router, endpoint)
            eventually(lambda: len(after.frames) > 5, "frames after the restart")
            run_id = after.frames[0].run_id
            assert ask_json(router, KEYS.status)["run_id"] == f"{run_id:016x}"
            assert [str(r.ok.key_expr) for r in router.liveliness().get(KEYS.alive) if r.ok] == [KEYS.alive]
            last, first = before.frames[-1].sequence, after.frames[0].sequence
            if first > last + 1:
                missed = fetch_frames(router, "lab", "g1", run_id, last + 1, first - 1)
                assert [frame.sequence for frame in missed] == list(range(last + 1, first))
            summary = capture.finish()
    assert [frame.sequence for frame in logged(summary.log)] == list(range(summary.frames))


def test_damaged_tail_of_an_earlier_run_is_repaired_at_start(wire: Wire, tmp_path: Path) -> None:
    with capturing(SignalGenerator(rate_hz=1000, frames=20), wire.endpoint, tmp_path) as capture:
        earlier = eventually(lambda: capture.summary, "the first run ends")
    content = earlier.log.read_bytes()
    earlier.log.write_bytes(content[:-3])
    with capturing(SignalGenerator(rate_hz=1000, frames=20), wire.endpoint, tmp_path) as capture:
        eventually(lambda: capture.ended, "the second run ends")
    assert any("damaged bytes" in sentence and earlier.log.name in sentence for sentence in capture.sentences)
    (earlier.log.parent / "x-0000000000000000.glvlog").write_bytes(b"nothing")
    with capturing(SignalGenerator(rate_hz=1000, frames=20), wire.endpoint, tmp_path) as capture:
        eventually(lambda: capture.ended, "the third run ends")
    assert any("left as it is" in sentence for sentence in capture.sentences)
    assert [frame.sequence for frame in logged(earlier.log)] == list(range(19))


def test_clients_reach_the_capture_through_the_router(wire: Wire, tmp_path: Path) -> None:
    with capturing(SignalGenerator(), wire.endpoint, tmp_path), open_client([wire.endpoint]) as client:
        heard: list[int] = []
        subscriber = client.declare_subscriber(
            KEYS.raw, lambda sample: heard.append(decode_frame(sample.payload.to_bytes()).sequence)
        )
        eventually(lambda: len(heard) > 5, "frames")
        subscriber.undeclare()
        assert heard == sorted(set(heard))
