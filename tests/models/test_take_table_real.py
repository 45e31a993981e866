"""The real recordings beside the repository, as far as they are there."""

from __future__ import annotations

from pathlib import Path

import pytest

from glovecal_models.errors import BadTakeTable
from glovecal_models.takes.table import read_takes, reference_warnings

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


def test_flex_glove_frames_were_stamped_in_batches():
    files = frame_files("flex-glove-holds")
    with pytest.raises(BadTakeTable, match="batches"):
        read_takes(files[0])
    takes = [take for path in files for take in read_takes(path, equal_times="spread")]
    assert len(takes) == 15
    assert {pose for take in takes for pose in take.poses or ()} == {"fist", "flat_hand", "grab"}
