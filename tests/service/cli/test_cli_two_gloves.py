"""Two hands at the command line, over real zenoh: recorded together, filmed, joined; shapes at both ends."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import ExitStack
from functools import partial
from pathlib import Path

import pytest
from cli_running import glovecal, start
from realtime_support import eventually, free_endpoint

HANDS = ("right", "left")


@pytest.fixture(scope="module")
def live(tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, str]]:
    """A service, and both hands of a simulated person captured from it."""
    folder, endpoint = tmp_path_factory.mktemp("two"), free_endpoint()
    port = free_endpoint().rpartition(":")[2]
    settings = {"GLOVECAL_DATA": str(folder / "data"), "GLOVECAL_ZENOH": endpoint, "GLOVECAL_PORT": port}
    settings |= {"GLOVECAL_STUDIO": "no"}
    with ExitStack() as running:
        process = start(settings, "serve")
        running.callback(end, process)
        assert process.stdout is not None
        assert process.stdout.readline().startswith("Glovecal is running")
        reach = {"GLOVECAL_URL": f"http://127.0.0.1:{port}", "GLOVECAL_ZENOH": endpoint}
        reach["GLOVECAL_DATA"] = str(folder / "capture")
        for seed, hand in enumerate(HANDS):
            options = ("--option", f"seed={seed}", "--option", f"hand={hand}", "--option", "rate_hz=60")
            capture = start(
                reach, "capture", "--device", "simulated", "--glove", hand, "--subject", "anna",
                "--wearing", "monday", *options,
            )  # fmt: skip
            running.callback(end, capture)
        seen = lambda: len(json.loads(glovecal(reach, "glove", "list", "--json").out)["seen"]) == 2  # noqa: E731
        eventually(seen, "both are seen")
        yield reach


def end(process) -> None:
    process.terminate()
    process.communicate(timeout=60)


def test_both_hands_are_recorded_filmed_and_joined(
    live: dict[str, str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("cv2")
    monkeypatch.chdir(tmp_path)
    run = partial(glovecal, live)
    done = run(
        "record", "right", "both", "--with", "left", "--seconds", 2, "--pre-roll", 0, "--video", "rendered",
        "--json",
    )  # fmt: skip
    assert "has been captured for 0 of 20 minutes" in done.err
    right, left = (one["facts"]["take"] for one in done.json)
    about = json.loads((tmp_path / "both.json").read_text())
    assert about["takes"] == [right, left]
    assert about["pictures"] > 20
    stamps = (tmp_path / "both.times.csv").read_text().splitlines()
    assert len(stamps) == about["pictures"] + 1
    told = run("take", "hands", right, left, "--json").json
    assert (told["how"], told["shift_s"]) == ("one computer", 0)
    assert told["sd_s"] < 0.02
    assert run("take", "motion", tmp_path / "both.trc", right, left, "--content", "raw").code == 0
    markers = (tmp_path / "both.trc").read_text().splitlines()[3]
    assert "R_index" in markers
    assert "L_index" in markers
    assert [row["name"] for row in run("subject", "list", "--json").json] == ["anna"], "nobody added her"
    assert "hand           right and left" in run("subject", "show", "anna").out
    hands = {row["id"]: row["known_hand"] for row in run("take", "list", "--json").json}
    assert {id: hands[id] for id in (right, left)} == {right: "right", left: "left"}


def test_hands_that_held_no_shape_are_told_no_drift(live: dict[str, str]) -> None:
    run = partial(glovecal, live)
    for place in ("start", "end"):
        done = run("shapes", *HANDS, "--at", place, "--seconds", 1.5, "--pause", 0)
        assert "10 takes of 5 shapes." in done.out, done.err
    for hand in HANDS:  # they moved freely all the time
        assert (
            f"anna, {hand} hand: no shape was held at both ends, so no drift is known (flat: the" in done.out
        )


def test_a_glove_without_a_card_says_so(live: dict[str, str]) -> None:
    said = glovecal(live, "card", *HANDS)
    assert said.code == 1
    assert "is only listened to: it has no commands" in said.err
