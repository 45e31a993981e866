"""Results on disk: a damaged one is computed again, never used."""

import os

import numpy as np
import pytest

from glovecal_models.errors import BadInput
from glovecal_service.jobs.finished_tasks import FinishedTasks
from glovecal_service.jobs.job_kind import TaskResult

KEY = "ab" * 32


@pytest.fixture
def finished(tmp_path):
    return FinishedTasks(tmp_path)


def test_a_result_comes_back(finished):
    assert finished.get(KEY) is None
    finished.put(KEY, TaskResult({"weights": np.arange(4.0), "none": np.empty((0, 3))}, {"held_out": 1.5}))
    result = finished.get(KEY)
    assert result.facts == {"held_out": 1.5}
    assert result.arrays["weights"].tolist() == [0, 1, 2, 3]
    assert result.arrays["none"].shape == (0, 3)


def test_every_damaged_byte_makes_it_unknown(finished, tmp_path):
    finished.put(KEY, TaskResult({"weights": np.arange(2.0)}, {}))
    [path] = tmp_path.iterdir()
    content = path.read_bytes()
    for place in range(len(content)):
        path.write_bytes(content[:place] + bytes([content[place] ^ 0x10]) + content[place + 1 :])
        assert finished.get(KEY) is None
        assert not path.exists()
    for length in range(len(content)):
        path.write_bytes(content[:length])
        assert finished.get(KEY) is None


@pytest.mark.parametrize("key", ["", "../x", "AB" * 32, "*", "ab", "ab" * 32 + "\n"])
def test_other_keys_reach_no_path(finished, key):
    with pytest.raises(BadInput):
        finished.get(key)
    with pytest.raises(BadInput):
        finished.put(key, TaskResult({}, {}))


def test_what_was_not_used_for_longest_goes_first(finished, tmp_path):
    keys = [f"{number:02d}" * 16 for number in range(4)]
    for age, key in enumerate(keys):
        finished.put(key, TaskResult({"zeros": np.zeros(100)}, {}))
        [path] = tmp_path.glob(f"{key}.*")
        os.utime(path, (1_000_000 + age, 1_000_000 + age))
    assert finished.get(keys[0]) is not None
    size = max(path.stat().st_size for path in tmp_path.iterdir())
    finished.prune(kept_bytes=2 * size)
    assert [finished.get(key) is not None for key in keys] == [True, False, False, True]
