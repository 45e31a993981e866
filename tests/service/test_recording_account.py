"""The account of a recording, whatever arrives, is lost, is killed, or cannot be asked for a while.

No network: the recording's file and the capture daemon's logs are real, and lie on disk.
"""

from __future__ import annotations

import json
import tempfile
from contextlib import ExitStack, closing
from dataclasses import dataclass, replace
from pathlib import Path
from threading import Event

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from glovecal_client import Frame, Recording, encode_frame
from glovecal_client.capture.log_folder import LogFolder, LogQueries
from glovecal_client.errors import BadName, NoAnswer, QueryRefused
from glovecal_client.gap_repair import BlockDigest, split_frames
from glovecal_client.keys import GloveKeys
from glovecal_service.recorder import reconciliation
from glovecal_service.recorder.log_comparison import reconcile_and_compare
from glovecal_service.recorder.reconciliation import CaptureRun, CaptureStanding, Patience
from glovecal_service.recorder.recording_result import Settlement
from glovecal_service.recorder.run_ledger import (
    BEGIN,
    CREATED,
    FINDINGS,
    RunLedger,
    frames_taken_out,
    usable_frames,
)

MS = 1_000_000
STRANGE = np.array([-1.0], np.float32)
CLOCK_AHEAD_NS = 3_600_000 * MS
"""The capture computer's clock is an hour ahead, until it is set."""
CLOCK_STEPS_NS = (-7_200_000 * MS, -30 * MS, 30 * MS, 7_200_000 * MS)


@dataclass
class NumberedFrame:
    frame: Frame
    logged: bool


class Capture:
    """Numbers frames into real logs, as the daemon does; ``now_ns`` is the service's clock."""

    def __init__(self, folder: Path, tells_monotonic: bool) -> None:
        self.open = ExitStack()
        self.tells_monotonic = tells_monotonic
        self.ahead_ns = CLOCK_AHEAD_NS
        self.folder = self.open.enter_context(closing(LogFolder(folder, GloveKeys("lab", "g1"))))
        self.numbered: list[NumberedFrame] = []
        self.now_ns = 1_000_000 * MS
        self.reachable = True
        self.disk_full = False
        self.runs: list[CaptureRun] = []
        self.waiting: list[NumberedFrame] = []
        """In the daemon's memory, for room in its log."""
        self.restart()

    def restart(self) -> None:
        self.now_ns += 50 * MS
        started_ns = self.now_ns if self.tells_monotonic else None
        self.runs.append(CaptureRun(len(self.runs) + 1, self.now_ns + self.ahead_ns, started_ns))
        self.log = self.open.enter_context(closing(self.folder.create(self.runs[-1].run_id, {})))
        self.queries = LogQueries(self.folder)
        self.sequence = -1
        self.waiting.clear()

    def frame(self, logged: bool, step_ns: int = 8 * MS) -> Frame:
        self.now_ns += step_ns
        self.sequence += 1
        wall_ns = self.now_ns + self.ahead_ns
        readings = np.array([self.sequence], np.float32)
        frame = Frame(self.sequence, self.runs[-1].run_id, self.now_ns, wall_ns, readings)
        self.numbered.append(NumberedFrame(frame, logged=False))
        if logged:
            self.waiting.append(self.numbered[-1])
            self.make_room(not self.disk_full)
        return frame

    def make_room(self, room: bool) -> None:
        self.disk_full = not room
        while room and self.waiting:
            numbered = self.waiting.pop(0)
            self.log.append(encode_frame(numbered.frame))
            numbered.logged = True

    def standing(self) -> CaptureStanding:
        self._check()
        now = (self.now_ns, self.now_ns)
        return CaptureStanding(tuple(self.runs), self.sequence, self.disk_full, self.ahead_ns, *now)

    def block(self, run_id: int, first: int, last: int) -> list[Frame]:
        self._check()
        try:
            return split_frames(self.queries.answer(f"run={run_id:016x};from={first};to={last}"))
        except BadName as error:
            raise QueryRefused(str(error)) from error

    def digest(self, run_id: int, first: int, last: int) -> BlockDigest | None:
        self._check()
        try:
            answer = self.queries.answer(f"run={run_id:016x};from={first};to={last};digest=sha256")
        except BadName as error:
            raise QueryRefused(str(error)) from error
        found = json.loads(answer)
        return BlockDigest(**found) if found["frames"] else None

    def _check(self) -> None:
        if not self.reachable:
            raise NoAnswer("nobody answered")


FORGED_NUMBERS = (1, 2, 400, 5000, 0, -1)
"""Of frames of a stranger, against the last number given: the next ones, far ahead, and those that were."""

STEPS = st.lists(
    st.one_of(
        st.tuples(st.just("received"), st.integers(1, 5)),
        st.tuples(st.just("lost"), st.integers(1, 5)),
        st.tuples(st.just("received, not logged"), st.integers(1, 2)),
        st.tuples(st.just("lost, not logged"), st.integers(1, 2)),
        st.tuples(st.just("killed"), st.integers(0, 5)),
        st.tuples(st.just("restarted"), st.integers(0, 2)),
        st.tuples(st.just("unreachable"), st.just(0)),
        st.tuples(st.just("disk full, or room again"), st.just(0)),
        st.tuples(st.just("clock set"), st.integers(0, len(CLOCK_STEPS_NS) - 1)),
        st.tuples(st.just("forged"), st.integers(0, 3 * len(FORGED_NUMBERS) - 1)),
    ),
    min_size=1,
    max_size=12,
)


class Story:
    """A recording from its begin on."""

    def __init__(self, folder: Path, tells_monotonic: bool) -> None:
        self.capture = Capture(folder, tells_monotonic)
        for _ in range(3):
            self.capture.frame(True)
        self.path = folder / "recording.glog"
        wall_ns = self.capture.numbered[-1].frame.wall_ns
        begin = {"run_id": f"{1:016x}", "sequence": self.capture.sequence, "wall_ns": wall_ns}
        begin["clock_ahead_ns"] = CLOCK_AHEAD_NS
        meta = {BEGIN: begin, CREATED: self.capture.now_ns}
        self.file = self.opened(RunLedger.create(self.path, meta))
        self.begin = len(self.capture.numbered)
        self.findings: dict[str, dict] = {}
        """What a recording's row has of it."""

    def tell(self, what: str, count: int) -> None:
        if what == "killed":
            self.file = self.kill(count)
        elif what == "restarted":
            self.capture.restart()
        elif what == "unreachable":
            self.capture.reachable = not self.capture.reachable
            return
        elif what == "disk full, or room again":
            self.capture.make_room(self.capture.disk_full)
            return
        elif what == "clock set":
            self.capture.ahead_ns += CLOCK_STEPS_NS[count] if self.capture.tells_monotonic else 0
            return
        elif what == "jumped":
            self.capture.sequence += count
            return
        elif what == "forged":
            self.forge(count)
            return
        step_ns = MS // 10 if "in no time" in what else 8 * MS
        for _ in range(count):
            frame = self.capture.frame("not logged" not in what, step_ns)
            if what.startswith("received"):
                self.file.add(frame, encode_frame(frame))

    def forge(self, kind: int) -> None:
        """A frame of a stranger: any of the numbers, by a clock that is right, or ahead, or far ahead."""
        last = self.capture.numbered[-1].frame
        clock, ahead = divmod(kind, len(FORGED_NUMBERS))
        frame = replace(
            last,
            sequence=max(0, self.capture.sequence + FORGED_NUMBERS[ahead]),
            run_id=self.capture.runs[-1].run_id,
            monotonic_ns=last.monotonic_ns + clock * 40_000 * MS + 1,
            wall_ns=last.wall_ns + (kind % 2) * 90_000 * MS,
            readings=STRANGE,
        )
        self.file.add(frame, encode_frame(frame))

    def kill(self, frames_meanwhile: int) -> RunLedger:
        """The process is gone with what it knew; the file is left as it was."""
        for _ in range(frames_meanwhile):
            self.capture.frame(True)
        return self.opened(RunLedger.resume(self.path))

    def opened(self, file: RunLedger) -> RunLedger:
        """A killed process' file is closed at the very end; nothing waits in it that this would write."""
        return self.capture.open.enter_context(closing(file))

    def settle(self, stop_ns: int) -> Settlement:
        file = RunLedger.resume(self.path, self.findings)
        outcome = reconcile_and_compare(file, self.capture, stop_ns, Patience(60.0, Event()))
        file.close()
        settlement = Settlement.of(file, outcome)
        self.findings = settlement.account[FINDINGS]
        return settlement

    def keys(self, runs: list[dict], what: str) -> set[tuple[int, int]]:
        ranges = [(int(run["run_id"], 16), *gap) for run in runs for gap in run[what]]
        return {(run, number) for run, first, last in ranges for number in range(first, last + 1)}


def check(story: Story, settlement: Settlement, stop_ns: int) -> None:
    account = settlement.account
    lacking = story.keys(account["runs"], "missing")
    assert account["sent"] == account["recorded"] + account["missing_frames"] + account["pending_frames"]
    assert len(lacking) == account["missing_frames"] + account["pending_frames"]
    if not account["complete"]:
        assert account["missing"] == []
        return
    used = list(usable_frames(Recording.open(story.path), frames_taken_out(account[FINDINGS])))
    recorded = {(frame.run_id, frame.sequence) for frame in used}
    given = {(item.frame.run_id, item.frame.sequence) for item in story.capture.numbered}
    if account["compared"]:
        assert lacking <= given, "a number that was never given is not missing"
        assert not [frame for frame in used if frame.readings[0] == -1.0], "nothing of a stranger is used"
    in_log = [item.frame for item in story.capture.numbered if item.logged]
    logged = {(frame.run_id, frame.sequence): frame for frame in in_log}
    for frame in used:
        key = (frame.run_id, frame.sequence)
        assert key not in logged or logged[key].readings[0] == frame.readings[0], "it is the log's"
    first = (account["runs"][0]["run_id"], account["first_sequence"])
    last = {run["run_id"]: run["last_sequence"] for run in account["runs"]}
    for item in story.capture.numbered[story.begin :]:
        key = (item.frame.run_id, item.frame.sequence)
        run_id = f"{key[0]:016x}"
        if run_id == first[0] and key[1] < first[1]:
            continue
        if item.logged:
            assert key not in lacking, "nothing that is logged is missing"
            is_due = item.frame.monotonic_ns <= stop_ns
            assert not is_due or key in recorded, "what was logged up to the stop is recorded"
        elif key[1] <= last.get(run_id, -1):
            assert key in recorded | lacking, "a number that was given is told of"


@settings(max_examples=150)
@example(
    before=[("received", 3), ("lost in no time", 1500), ("received", 2)],
    after=[("received", 1)],
    tells_monotonic=True,
)
@example(
    before=[("unreachable", 0), ("received", 3), ("jumped", 5000), ("lost", 2), ("received", 2)],
    after=[("received", 1)],
    tells_monotonic=True,
)
@example(
    before=[("forged", 2), ("received, not logged", 2), ("lost", 1)],
    after=[("unreachable", 0)],
    tells_monotonic=True,
)
@example(before=[("received", 1)], after=[("forged", 16)], tells_monotonic=True)
@example(
    before=[("disk full, or room again", 0), ("lost", 2), ("received", 2)],
    after=[("received", 1)],
    tells_monotonic=True,
)
@example(
    before=[("disk full, or room again", 0), ("received", 2)], after=[("received", 1)], tells_monotonic=True
)
@example(
    before=[("restarted", 2), ("restarted", 0), ("received", 1)],
    after=[("received", 1)],
    tells_monotonic=True,
)
@given(before=STEPS, after=STEPS, tells_monotonic=st.booleans())
def test_every_frame_up_to_the_stop_is_recorded_or_missing(
    before: list[tuple[str, int]], after: list[tuple[str, int]], tells_monotonic: bool
) -> None:
    with tempfile.TemporaryDirectory() as folder, pytest.MonkeyPatch.context() as patch:
        patch.setattr(reconciliation, "UNANSWERED_FOR_S", -1.0)
        story = Story(Path(folder), tells_monotonic)
        with story.capture.open:
            for what, count in before:
                story.tell(what, count)
            stop_ns = story.capture.now_ns
            first = story.settle(stop_ns)
            check(story, first, stop_ns)
            assert first.account["complete"] or not story.capture.reachable or story.capture.disk_full
            for what, count in after:
                if "received" not in what and "lost" not in what:
                    story.tell(what, count)
                else:
                    for _ in range(count):
                        story.capture.frame(True)
            story.capture.reachable = True
            story.capture.make_room(True)
            if first.is_final:
                logged = {
                    (item.frame.run_id, item.frame.sequence) for item in story.capture.numbered if item.logged
                }
                missing = story.keys(first.account["runs"], "missing")
                assert not missing & logged, "what is missing for good never comes into the log"
            last = story.settle(stop_ns)
            assert last.account["complete"]
            check(story, last, stop_ns)
            again = story.settle(stop_ns)
            assert again.account == last.account, "a second repair changes nothing"


def test_a_killed_capture_gave_no_number_that_its_own_later_frames_contradict() -> None:
    """Nobody says any more how far it came: a stranger's number far ahead is told by its time."""
    with tempfile.TemporaryDirectory() as folder:
        story = Story(Path(folder), tells_monotonic=True)
        with story.capture.open:
            for step in [("received", 2), ("forged", 2), ("received", 3), ("restarted", 0), ("received", 1)]:
                story.tell(*step)
            stop_ns = story.capture.now_ns
            settlement = story.settle(stop_ns)
            check(story, settlement, stop_ns)
    account = settlement.account
    assert (account["compared"], account["taken_out"], account["missing_frames"]) == (True, 1, 0)
    assert account["recorded"] == 6


@pytest.mark.parametrize("clock_set", [(), (0,), (3,), (0, 3)])
@pytest.mark.parametrize("later", [0, 3])
def test_a_run_that_no_capture_had_is_told_by_the_run_that_went_on_meanwhile(
    later: int, clock_set: tuple[int, ...]
) -> None:
    """``later``: frames of the capture's own that were recorded after it; ``clock_set`` before it."""
    with tempfile.TemporaryDirectory() as folder:
        story = Story(Path(folder), tells_monotonic=True)
        with story.capture.open:
            story.tell("received", 2)
            for step in clock_set:
                story.tell("clock set", step)
                story.tell("received", 2)
            last = story.capture.numbered[-1].frame
            forged = replace(
                last,
                sequence=0,
                run_id=99,
                monotonic_ns=last.monotonic_ns + 1,
                wall_ns=last.wall_ns + 1,
                readings=STRANGE,
            )
            story.file.add(forged, encode_frame(forged))
            story.tell("received", later)
            settlement = story.settle(story.capture.now_ns)
            check(story, settlement, story.capture.now_ns)
    account = settlement.account
    frames = 2 + 2 * len(clock_set) + later
    assert (account["compared"], account["taken_out"], account["recorded"]) == (True, 1, frames)
    assert settlement.outcome.why == ""


def test_a_number_that_a_killed_capture_never_gave_moves_no_later_run_in_time() -> None:
    """The run after it begins, by the computer's clock, before the frame was captured."""
    with tempfile.TemporaryDirectory() as folder:
        story = Story(Path(folder), tells_monotonic=True)
        with story.capture.open:
            story.tell("received", 2)
            last = story.capture.numbered[-1].frame
            later_ns = last.monotonic_ns + 100_000 * MS
            forged = replace(last, sequence=last.sequence + 1, monotonic_ns=later_ns, readings=STRANGE)
            story.file.add(forged, encode_frame(forged))
            for step in [("restarted", 0), ("received", 3)]:
                story.tell(*step)
            settlement = story.settle(story.capture.now_ns)
            check(story, settlement, story.capture.now_ns)
    account = settlement.account
    assert (account["compared"], account["taken_out"], account["recorded"]) == (True, 1, 5)
