"""The fault study: thirty faults lose nothing, what fails leaves nothing running, the checker sees losses."""

from __future__ import annotations

import ast
import dataclasses
import sys
import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import fault_study
import numpy as np
import psutil
import pytest
from fault_catalogue import CATALOGUE, RULE, catalogue_table
from fault_history import recording_problems
from fault_kinds import KINDS, STUDY_PACE, SUITE_PACE, plan
from fault_study import CATALOGUE_MARKS, MARKS, Results, put, run_round, table
from fault_world import RecordingAsked

from glovecal_client.wire.frame import Frame

ROOT = Path(__file__).resolve().parents[2]
SEED = 2
on_linux = pytest.mark.skipif(sys.platform != "linux", reason="processes are found by their ports in /proc")


@on_linux
def test_thirty_faults_lose_nothing() -> None:
    results, began = Results(), time.monotonic()
    run_round(SEED, 30, SUITE_PACE, results, print)
    print(f"{table(results)}\n{time.monotonic() - began:.0f} s")
    assert results.violations == []
    assert results.times.total() == 30
    (history,) = results.histories
    assert history.takes >= 4
    assert history.frames_in_takes > 500
    assert history.writes > 20


@on_linux
def test_what_fails_leaves_nothing_running(monkeypatch: pytest.MonkeyPatch) -> None:
    folders = []

    def fail(world: Any, group: Any) -> None:
        folders.append(str(world.folder))
        raise KeyboardInterrupt

    monkeypatch.setattr(fault_study, "inflict", fail)
    with pytest.raises(KeyboardInterrupt):
        run_round(SEED, 1, SUITE_PACE, Results(), print)
    (folder,) = folders
    left = []
    for process in psutil.process_iter():
        try:
            if any(folder in word for word in (*process.cmdline(), *process.environ().values())):
                left.append(process.cmdline())
        except psutil.Error:
            continue
    assert left == []
    assert folder not in Path("/proc/mounts").read_text()
    assert not Path(folder).exists()


def test_a_seed_draws_the_same_faults_and_many_draw_all_of_them() -> None:
    assert plan(SEED, 30, SUITE_PACE) == plan(SEED, 30, SUITE_PACE) != plan(SEED + 1, 30, SUITE_PACE)
    drawn = [fault for seed in range(40) for group in plan(seed, 30, STUDY_PACE) for fault in group]
    assert len(drawn) == 40 * 30
    wanted = {(name, target) for name, kind in KINDS.items() for target in kind.targets}
    assert {(fault.kind, fault.target) for fault in drawn} == wanted
    for group in plan(SEED, 30, STUDY_PACE, without=["disk full"]):
        names = [(fault.kind, fault.target) for fault in group]
        assert len(names) == len(set(names)), "nothing is done twice at once"
        assert "disk full" not in {fault.kind for fault in group}


# The checker, on recordings that were made up.

MS = 1_000_000
FRAMES = [
    Frame(number, 1, (1000 + 10 * number) * MS, 0, np.array([number, 5], np.float32)) for number in range(40)
]


def problems(rows: list[Frame], stop: Frame = FRAMES[29], **told: Any) -> list[str]:
    """Of a recording whose take has these rows."""
    facts = {"take": "t", "sentence": "20 frames sent", "sent": 20, "recorded": 20, "missing_frames": 0}
    taken = SimpleNamespace(
        time_s=np.array([frame.monotonic_ns for frame in rows]) / 1e9,
        readings=np.array([frame.readings for frame in rows], float),
    )
    store = SimpleNamespace(takes=SimpleNamespace(load=lambda id: taken))
    record = SimpleNamespace(state=told.pop("state", "done"), facts=facts | {"pending_frames": 0} | told)
    return recording_problems(store, record, RecordingAsked("r", "left", stop.monotonic_ns), FRAMES)  # type: ignore[arg-type]


def test_a_take_that_is_the_log_has_no_problem() -> None:
    assert problems(FRAMES[10:30]) == []


@pytest.mark.parametrize(
    ("rows", "told", "words"),
    [
        (
            FRAMES[10:15] + FRAMES[16:30],
            {},
            "1 logged frames between its first and its last are not in the take",
        ),
        (FRAMES[10:25], {}, "ends 5 logged frames before its end was asked for"),
        (
            [*FRAMES[10:29], dataclasses.replace(FRAMES[29], readings=np.array([7, 7], np.float32))],
            {},
            "1 frames of the take are not as logged",
        ),
        (
            [*FRAMES[10:30], dataclasses.replace(FRAMES[29], monotonic_ns=5000 * MS)],
            {},
            "1 frames of the take are in no log",
        ),
        (FRAMES[10:30], {"recorded": 19}, "the account does not add up"),
        (FRAMES[10:30], {"state": "repairing"}, "is still 'repairing'"),
        (FRAMES[10:30], {"state": "failed", "sentence": "it broke"}, "failed: it broke"),
    ],
)
def test_what_was_lost_is_seen(rows: list[Frame], told: dict[str, Any], words: str) -> None:
    (found,) = problems(rows, **told)
    assert words in found


def test_what_is_told_is_no_problem() -> None:
    unlogged = dataclasses.replace(FRAMES[29], monotonic_ns=5000 * MS)
    told = "20 frames sent; not compared with the capture log: 1 frames are not in it"
    assert problems([*FRAMES[10:30], unlogged], sentence=told) == []
    assert (
        problems([], state="failed", sentence="recording r was stopped before it began: nothing was recorded")
        == []
    )


# The catalogue, and the page that has it.


def test_every_row_of_the_catalogue_names_tests_and_kinds_that_exist() -> None:
    assert [row.number for row in CATALOGUE] == list(range(1, 33))
    unknown = []
    for row in CATALOGUE:
        for place in row.shown_by:
            if place.startswith(RULE):
                if place.removeprefix(RULE) not in KINDS:
                    unknown.append(place)
                continue
            file, _, name = place.partition("::")
            tree = ast.parse((ROOT / file).read_text(encoding="utf-8"))
            if name not in {node.name for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)}:
                unknown.append(place)
    assert unknown == []


def test_the_page_has_the_catalogue_of_today(tmp_path: Path) -> None:
    page = tmp_path / "faults.md"
    kept = (ROOT / "docs" / "faults.md").read_text(encoding="utf-8")
    page.write_text(kept, encoding="utf-8")
    put(page, CATALOGUE_MARKS, catalogue_table())
    assert page.read_text(encoding="utf-8") == kept, (
        "python3 do.py study faults --table --page docs/faults.md"
    )
    put(page, MARKS, table(Results()))
    assert "| kill -9 | 0 |" in page.read_text(encoding="utf-8")
    page.write_text("# No marks\n", encoding="utf-8")
    with pytest.raises(ValueError, match="has no lines"):
        put(page, MARKS, "text")
