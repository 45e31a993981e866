"""Held poses on the command line: without a model, and with a reference of 0 and 1."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from cli_running import Run

from glovecal_models.takes.take import Take
from glovecal_models.takes.write_table import write_takes

HOLDS, HOLD_S, RATE_HZ = 8, 16.0, 5.0
VERDICT = "consistent with creep, or the hand relaxing"


def creeping(number: int) -> Take:
    """Flat and fist by turns; in the fist two sensors go back by 5 % with 4 s."""
    random = np.random.default_rng(number)
    time = np.arange(0.0, HOLDS * HOLD_S, 1 / RATE_HZ)
    fist = (time // HOLD_S).astype(int) % 2
    since = time % HOLD_S
    shape = fist * (0.95 + 0.05 * np.exp(-since / 4.0))
    readings = np.column_stack([200 + 100 * shape, 90 - 60 * shape]) + 0.5 * random.normal(
        size=(len(time), 2)
    )
    poses = tuple("fist" if closed else "flat" for closed in fist)
    return Take(f"t{number}", "monday", ("I_FLEX", "M_FLEX"), time, readings, poses=poses)


def numbered(take: Take) -> Take:
    level = np.array([[float(pose == "fist")] for pose in take.poses or ()])
    return replace(take, rotations=("FIST",), reference_time_s=take.time_s.copy(), reference=level)


def test_poses_alone_show_what_readings_do_while_they_are_held(run: Run, tmp_path: Path) -> None:
    write_takes([creeping(0), creeping(1)], tmp_path / "poses.csv")
    run("subject", "add", "ada")
    assert run("take", "import", tmp_path / "poses.csv", "-s", "ada").code == 0
    answer = run("take", "holds", "-s", "ada")
    assert answer.code == 0, answer.err
    said = " ".join(answer.out.split())
    assert VERDICT in said
    assert "To decide, record 180 s: Close the hand around a rigid form" in said
    found = run("take", "holds", "t0", "t1", "--json").json
    assert (found["verdict"], found["confidence_set"]) == ("ambiguous", ["creep", "hand_relaxing"])
    assert found["poses"][0]["sensors"]["I_FLEX"]["change_pct"] < -3
    refused = run("improve", "-s", "ada")
    assert refused.code == 1
    assert "glovecal take holds --subject ada" in refused.said


def test_a_reference_of_0_and_1_is_told_of_by_improve_diagnose_and_their_pages(
    run: Run, tmp_path: Path
) -> None:
    table, page = tmp_path / "numbers.csv", tmp_path / "page.html"
    write_takes([numbered(creeping(0)), numbered(creeping(1))], table)
    options = ("--method", "linear", "--report", page, "--json")
    walk = run("improve", "--takes", table, *options).json
    assert [step["added"] for step in walk["steps"]] == [None]
    assert walk["stopped"] == "ambiguous"
    assert walk["next_take"]["separates"] == ["creep", "hand_relaxing"]
    assert any(VERDICT in sentence for sentence in walk["sentences"])
    assert "Readings while a pose is held" in page.read_text()
    told = run("diagnose", walk["steps"][0]["model"], "--report", page, "--overwrite")
    assert told.code == 0, told.err
    assert VERDICT in " ".join(told.out.split())
    assert "the reference only names poses" in " ".join(told.out.split())
    assert VERDICT in page.read_text()


def test_frames_stamped_in_batches_are_spread_when_asked(run: Run, tmp_path: Path) -> None:
    table = tmp_path / "batches.csv"
    write_takes([numbered(creeping(0)), numbered(creeping(1))], table)
    lines = table.read_text().splitlines()
    place = lines[0].split(",").index("time_s")
    rows = [line.split(",") for line in lines[1:]]
    for row, before in zip(rows[1::4], rows[0::4], strict=True):
        row[place] = before[place]
    table.write_text("\n".join([lines[0], *(",".join(row) for row in rows)]) + "\n")
    options = ("--method", "linear", "--max-steps", "0")
    refused = run("improve", "--takes", table, *options)
    assert refused.code == 1
    assert "--spread-equal-times" in refused.said
    assert run("improve", "--takes", table, "--spread-equal-times", *options).code == 0
