"""The real recordings beside the repository, as far as they are there."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from glovecal_models.errors import BadTakeTable
from glovecal_models.takes.reference_jumps import reference_warnings
from glovecal_models.takes.table import read_takes
from glovecal_models.takes.take import Take
from glovecal_models.takes.take_check import check_take

DATA = Path(__file__).parents[3] / "shared" / "data"
SETS = [  # folder, files, sensors, rotations, own reference clock
    ("ankle", 59, 4, 2, True),
    ("gait", 120, 4, 2, False),
    ("cyberglove-robot-thumb", 3, 20, 16, False),
    ("flex-static", 1, 1, 1, False),
]
pytestmark = pytest.mark.needs_shared_data


def frame_files(folder: str) -> list[Path]:
    return [path for path in sorted((DATA / folder).glob("*.csv")) if ".reference." not in path.name]


@pytest.mark.parametrize(("folder", "files", "sensors", "rotations", "own_clock"), SETS)
def test_every_recording_is_read_as_one_take(folder, files, sensors, rotations, own_clock):
    takes = [take for path in frame_files(folder) for take in read_takes(path)]
    assert len(takes) == files
    assert {len(take.sensors) for take in takes} == {sensors}
    assert {len(take.rotations) for take in takes} == {rotations}
    assert {take.has_own_reference_clock for take in takes} == {own_clock}
    assert not [warning for take in takes for warning in reference_warnings(take)]


@pytest.mark.parametrize("folder", [name for name, *_ in SETS])
def test_no_real_recording_is_taken_for_another_unit_and_all_are_in_radians(folder):
    for take in [take for path in frame_files(folder) for take in read_takes(path)]:
        assert unit_sentences(take) == []
        for start in range(0, len(take.time_s) - 20, 20):
            assert unit_sentences(cut(take, slice(start, start + 60))) == []
        assert "look like radians" in " ".join(
            unit_sentences(replace(take, reference=np.radians(take.reference)))
        ), take.name
        if (
            np.median(np.diff(take.time_s)) < 0.5
        ):  # single poses once a second are as far apart as frames at 1 kHz in ms
            for factor in (1e3, 1e6, 1e9):
                assert "time_s is wanted in seconds" in " ".join(unit_sentences(stretched(take, factor)))


def unit_sentences(take: Take) -> list[str]:
    return [text for text in check_take(take).sentences if "radians" in text or "time_s" in text]


def cut(take: Take, frames: slice) -> Take:
    """The frames, with all of the reference."""
    poses = None if take.poses is None else take.poses[frames]
    context = {name: column[frames] for name, column in take.context.items()}
    own = take.has_own_reference_clock
    return replace(
        take, time_s=take.time_s[frames], readings=take.readings[frames], context=context, poses=poses,
        reference_time_s=take.reference_time_s if own else take.reference_time_s[frames],
        reference=take.reference if own else take.reference[frames],
    )  # fmt: skip


def stretched(take: Take, factor: float) -> Take:
    return replace(take, time_s=take.time_s * factor, reference_time_s=take.reference_time_s * factor)


def test_flex_glove_frames_were_stamped_in_batches():
    files = frame_files("flex-glove-holds")
    with pytest.raises(BadTakeTable, match="batches"):
        read_takes(files[0])
    takes = [take for path in files for take in read_takes(path, equal_times="spread")]
    assert len(takes) == 15
    assert {pose for take in takes for pose in take.poses or ()} == {"fist", "flat_hand", "grab"}
