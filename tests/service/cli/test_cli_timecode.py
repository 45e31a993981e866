"""``glovecal take timecode``: from a sound file, entered, shown, forgotten, and refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from cli_running import Run
from ltc_sound import ltc_sound, write_wav


@pytest.fixture
def take(run: Run, tables: Path) -> Run:
    assert run("subject", "add", "anna").code == 0
    assert run("take", "import", tables / "train.csv", "-s", "anna").code == 0
    return run


@pytest.fixture
def sound(tmp_path: Path) -> Path:
    """24 s at 29.97 drop-frame over a minute's end, beside a silent channel."""
    labels = [(1, 2, 59, number) for number in range(10, 30)]
    labels += [(1, 3, second, number) for second in range(20) for number in range(30) if second or number > 1]
    signal = 0.4 * ltc_sound(labels, 30000 / 1001, 16_000, begin_s=0.25, drop=True, oversampling=40)
    return write_wav(tmp_path / "stage.wav", np.stack([0 * signal, signal], axis=1), 16_000)


def test_a_sound_gives_the_take_its_time_code(take: Run, sound: Path) -> None:
    done = take("take", "timecode", "poses", "--ltc", sound, "--at", 2.0)
    assert done.out.startswith("Take poses: time code 01:02:57;02 to 01:03:04;14, "), done.err
    assert "29.97 drop-frame frames a second, from LTC of stage.wav." in done.out
    assert "channel 2" in done.err
    code = take("take", "timecode", "poses", "--json").json["time_code"]
    (row,) = [row for row in take("take", "list", "--json").json if row["name"] == "poses"]
    assert row["time_code"] == code
    assert (code["label"], code["drop"]) == ("01:02:59;11", True)
    assert abs(code["time_s"] - (2.25 + 1001 / 30000)) < 1e-4, "the take's first frame is at 0 s"
    assert "time code " in take("take", "check", "poses").out


def test_a_time_code_is_entered_and_forgotten(take: Run) -> None:
    assert "no time code is known" in take("take", "timecode", "poses").out
    done = take("take", "timecode", "poses", "--label", "10:00:00:00", "--rate", 25, "--at", 1)
    assert "time code 09:59:59:00 to 10:" in done.out, done.err
    assert "25 frames a second, from entered" in done.out
    take("take", "leave-out", "poses", "--from", 0, "--to", 0.5)
    assert take("take", "timecode", "poses", "--json").json["time_code"]["time_s"] == 1.0, "by its clock"
    assert "no time code is known" in take("take", "timecode", "poses", "--remove").out
    assert take("take", "timecode", "poses", "--json").json == {"time_code": None}


def test_what_cannot_be_is_refused(take: Run, sound: Path, tables: Path) -> None:
    wrong = [
        (("--label", "10:00:00:25", "--rate", 25), "there is no time code 10:00:00:25 at 25"),
        (("--label", "10:00:00:00"), "does not tell its frame rate: give one of 23.976, 24"),
        (("--label", "noon", "--rate", 25), "'noon' is no time code"),
        (("--label", "10:00:00:00", "--rate", 26), "--rate 26 is none of"),
        (("--label", "10:00:00:00", "--remove"), "give one of --ltc, --label and --remove"),
        (("--ltc", tables / "train.csv"), "cannot be read as WAV"),
        (("--ltc", sound, "--channel", 1), "holds no time code (LTC) in channel 1"),
    ]
    for options, complaint in wrong:
        answer = take("take", "timecode", "poses", *options)
        assert answer.code in (1, 2)
        assert complaint in answer.said
