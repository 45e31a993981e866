"""What must be true once all is calm: every frame that was sent, and every write that was promised.

Frames are known from the captures' own logs, which no part of the service writes to.
"""

from __future__ import annotations

import re
import sqlite3
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from fault_world import GLOVES, SITE, RecordingAsked, World

from glovecal_client.frame_log import Recording
from glovecal_client.wire.frame import Frame
from glovecal_service.store import Store
from glovecal_service.store.errors import DamagedRows, NotFound
from glovecal_service.store.records import RecordingRecord

SETTLED_WITHIN_S = 120.0
NOTHING_RECORDED = ("was stopped before it began: nothing was recorded", "no frame of glove")
"""Of a recording that failed: nobody was there to record while it was asked for, and that is told."""
FINAL = ("done", "failed")


@dataclass(frozen=True)
class History:
    """What a round came to."""

    violations: list[str]
    frames: int
    """Sent by both gloves."""
    takes: int
    """Told complete, and held against the logs."""
    frames_in_takes: int
    missing: int
    nothing_recorded: int
    """Recordings that failed, and say that nothing was recorded."""
    writes: int
    settled_s: float
    """From the last recording's end to the last account."""


def logged(world: World, glove: str) -> list[Frame]:
    """Every frame that the glove's captures gave, by their monotonic clock."""
    logs = (world.captured / "capture" / SITE / glove).glob("*.glvlog")
    frames = [frame for log in logs for frame in Recording.open(log).frames()]
    return sorted(frames, key=lambda frame: frame.monotonic_ns)


def settle(world: World) -> float:
    """Wait until no recording has anything to come; how long that took. Raises nothing: what does not settle
    is found by ``check``."""
    began = time.monotonic()
    with Store.open(world.settings) as store:
        while time.monotonic() - began < SETTLED_WITHIN_S:
            if all(record.state in FINAL for record in store.recordings.list()):
                break
            time.sleep(0.1)
    return time.monotonic() - began


def check(world: World, settled_s: float) -> History:
    """Hold everything against everything; the service and the captures may go on."""
    violations = list(world.told)
    frames = {glove: logged(world, glove) for glove in GLOVES}
    for glove, all_frames in frames.items():
        violations += _log_problems(glove, all_frames)
    takes = in_takes = missing = nothing = 0
    with Store.open(world.settings) as store:
        violations += _database_problems(world, store)
        violations += _write_problems(world, store)
        for asked in world.recordings:
            try:
                record = store.recordings.get(asked.id)
            except NotFound:
                violations.append(f"recording {asked.id} was acknowledged and is not there")
                continue
            found = recording_problems(store, record, asked, frames[asked.glove])
            violations += [f"recording {record.name} ({record.id}): {problem}" for problem in found]
            nothing += record.state == "failed"
            if record.state == "done":
                takes += 1
                in_takes += record.facts["recorded"]
                missing += record.facts["missing_frames"]
    return History(
        violations, sum(map(len, frames.values())), takes, in_takes, missing, nothing,
        len(world.writes.acknowledged), settled_s,
    )  # fmt: skip


def _log_problems(glove: str, frames: Sequence[Frame]) -> list[str]:
    """Numbers of a run count from 0 without a gap."""
    numbers: dict[int, list[int]] = {}
    for frame in frames:
        numbers.setdefault(frame.run_id, []).append(frame.sequence)
    return [
        f"log of {glove}, run {run:016x}: its {len(found)} frames are not numbered 0 to {len(found) - 1}"
        for run, found in numbers.items()
        if found != list(range(len(found)))
    ]


def recording_problems(
    store: Store, record: RecordingRecord, asked: RecordingAsked, frames: Sequence[Frame]
) -> list[str]:
    """Of one recording, against ``frames``: all that the glove's captures logged, in order of time."""
    facts = record.facts
    if record.state == "failed":
        told = str(facts.get("sentence"))
        return [] if any(words in told for words in NOTHING_RECORDED) else [f"failed: {told}"]
    if record.state != "done":
        return [
            f"is still {record.state!r} {SETTLED_WITHIN_S:g} s after all was calm: {facts.get('sentence')}"
        ]
    problems = []
    if facts["sent"] != facts["recorded"] + facts["missing_frames"] + facts["pending_frames"]:
        counts = {name: facts[name] for name in ("sent", "recorded", "missing_frames", "pending_frames")}
        problems.append(f"the account does not add up: {counts}")
    try:
        take = store.takes.load(facts["take"])
    except (NotFound, KeyError):
        return [*problems, f"has no take: {facts.get('sentence')}"]
    told = f"told {facts['sentence']!r}"
    stamps_s = np.array([frame.monotonic_ns for frame in frames]) / 1e9
    known = np.isin(take.time_s, stamps_s)
    extra = int((~known).sum())
    not_in_it = re.search(r"(\d+) frames are not in it", facts["sentence"])
    if extra and (not_in_it is None or int(not_in_it[1]) < extra):
        problems.append(f"{extra} frames of the take are in no log, {told}")
    if not known.any():
        return [*problems, f"no frame of the take is in a log, {told}"]
    begins_s, ends_s = take.time_s[known][0], take.time_s[known][-1]
    inside = (stamps_s >= begins_s) & (stamps_s <= ends_s)
    due = [frame for frame, is_in in zip(frames, inside, strict=True) if is_in]
    log_s = stamps_s[inside]
    lacking = log_s[~np.isin(log_s, take.time_s)]
    if len(lacking):
        problems.append(
            f"{len(lacking)} logged frames between its first and its last are not in the take, {told}; "
            f"{_places(due, lacking)}"
        )
    else:
        readings = np.array([frame.readings for frame in due], dtype=np.float64)
        differ = (take.readings[known] != readings).any(axis=1) if len(due) else np.zeros(0, bool)
        if differ.any():
            problems.append(f"{int(differ.sum())} frames of the take are not as logged, {told}")
    if asked.stop_asked_ns:
        late = int(((stamps_s > ends_s) & (stamps_s <= asked.stop_asked_ns / 1e9)).sum())
        if late:
            problems.append(f"ends {late} logged frames before its end was asked for, {told}")
    return problems


def _places(due: Sequence[Frame], lacking: np.ndarray) -> str:
    times = set(lacking.tolist())
    numbers = [(f"{frame.run_id:016x}", frame.sequence) for frame in due if frame.monotonic_ns / 1e9 in times]
    return f"from {numbers[0]} to {numbers[-1]}"


def _database_problems(world: World, store: Store) -> list[str]:
    path = Path(store.database.files[0])
    connection = sqlite3.connect(f"file:{path}?mode=ro", uri=True)
    try:
        told = [row[0] for row in connection.execute("PRAGMA integrity_check")]
    finally:
        connection.close()
    problems = [f"database: {sentence}" for sentence in told if sentence != "ok"]
    lists: Sequence[Callable[[], Any]] = (store.takes.list, store.recordings.list, store.models.list)
    for each in lists:
        try:
            each()
        except DamagedRows as error:
            problems += [f"damaged row: {sentence}" for sentence in error.damaged]
    return problems + [f"audit: {sentence}" for sentence in store.audit.problems()]


def _write_problems(world: World, store: Store) -> list[str]:
    """Every acknowledged subject is there as it was written, and in the audit log."""
    acknowledged = dict(world.writes.acknowledged)  # more are written meanwhile
    there = {record.name: record.title for record in store.subjects.list()}
    audited = {
        change["key"]
        for entry in store.audit.every()
        for change in entry.changes
        if change["table"] == "subjects"
    }
    problems = []
    for name, title in acknowledged.items():
        if there.get(name) != title:
            problems.append(f"acknowledged write lost: subject {name} is {there.get(name)!r}, not {title!r}")
        if name not in audited:
            problems.append(f"acknowledged write of subject {name} is not in the audit log")
    return problems
