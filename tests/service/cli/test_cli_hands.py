"""The size of a subject's hand on the command line."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import pytest
from cli_running import glovecal


@pytest.fixture
def run(tmp_path: Path):
    return partial(glovecal, {"GLOVECAL_DATA": str(tmp_path / "data")})


def test_a_hand_is_measured_shown_and_exported(run, tmp_path: Path) -> None:
    assert run("subject", "add", "anna", "--hand-length-mm", 182, "--hand", "left").code == 0
    about = run("subject", "show", "anna").out
    assert "left" in about
    assert "hand_length 182.00" in about
    document = run("subject", "skeleton", "anna", "--json").json
    assert (document["format"], document["hand"]) == ("glovecal.skeleton.v1", "left")
    file = tmp_path / "anna.toml"
    file.write_text("hand_length = 176\nI_distal = 19.5\n")
    said = run("subject", "measure", "anna", "--dimensions", file).out
    assert said == "Subject anna: left hand, hand_length 176.00, I_distal 19.50 mm.\n"
    rows = [line.split(maxsplit=2) for line in run("subject", "skeleton", "anna").out.splitlines()]
    assert ["I_distal", "19.5", "measured"] in rows
    assert ["M_distal", "19.0", "from the hand length"] in rows
    assert run("subject", "skeleton", "anna", "--hand", "right", "--json").json["hand"] == "right"


def test_a_hand_that_cannot_be_is_refused_with_a_sentence(run, tmp_path: Path) -> None:
    assert run("subject", "add", "anna").code == 0
    small = run("subject", "measure", "anna", "--hand-length-mm", 19)
    assert (small.code, "lies between 60 and 300 mm" in small.said) == (1, True)
    assert "give --hand-length-mm, --dimensions or --hand" in run("subject", "measure", "anna").said
    file = tmp_path / "anna.toml"
    for content, sentence in [
        ("hand_length = 'long'", "anna.toml: hand_length is 'long'; give a number of mm"),
        ("I_distal = 20", "anna.toml: hand_length is missing"),
        ("hand_length", "anna.toml: not valid TOML: "),
        (
            "hand_length = 190\nI_distal = 90",
            "I_distal is 90 mm; with a hand of 190 mm it lies between 9 and 37",
        ),
    ]:
        file.write_text(content)
        answer = run("subject", "measure", "anna", "--dimensions", file)
        assert answer.code == 1
        assert sentence in answer.said
    assert run("subject", "skeleton", "anna").out.count("assumed") == 21
    assert run("subject", "measure", "anna", "--hand-length-mm", 190, "--hand", "both").code == 2
