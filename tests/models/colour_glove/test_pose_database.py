"""Poses and their sampling; a database is built once, the same in any number of processes, or not at all."""

import os
import shutil
from pathlib import Path

import numpy as np
import pytest

from glovecal_models.colour_glove import database as made
from glovecal_models.colour_glove.camera_model import Camera
from glovecal_models.colour_glove.database import (
    VIEW_FOCAL_PX,
    VIEW_PX,
    DatabaseSettings,
    PoseDatabase,
    orientations,
    pose_database,
    rendered_views,
)
from glovecal_models.colour_glove.hand_state import RANGE_DEG, HandState
from glovecal_models.colour_glove.pattern import glove_pattern
from glovecal_models.colour_glove.pose_set import (
    generated_poses,
    hand_shapes,
    low_dispersion,
    shape_features,
)
from glovecal_models.colour_glove.rasterise import rasterise
from glovecal_models.colour_glove.skin import hand_skin, posed
from glovecal_models.errors import BadInput, Cancelled

SKIN = hand_skin()
PATTERN = glove_pattern(SKIN)
MIDDLE = (VIEW_PX - 1) / 2


def test_poses_are_a_hands_and_the_same_for_the_same_seed():
    poses = generated_poses(500)
    assert poses.shape == (500, 20)
    assert ((poses >= RANGE_DEG[:, 0]) & (poses <= RANGE_DEG[:, 1])).all()
    assert np.array_equal(poses, generated_poses(500))
    assert not np.array_equal(poses, generated_poses(500, seed=2))
    assert len(hand_shapes()) == 26


def test_features_keep_the_rms_distance_of_vertices():
    poses = generated_poses(300)
    features = shape_features(SKIN, poses, every=1)
    states = [HandState(pose, np.eye(3), np.zeros(3)) for pose in poses]
    for a, b in [(0, 1), (5, 250), (17, 99)]:
        difference = posed(SKIN, states[a]) - posed(SKIN, states[b])
        expected = np.sqrt((difference**2).sum(axis=1).mean())
        assert np.linalg.norm(features[a] - features[b]) == pytest.approx(expected, rel=0.02)


def test_low_dispersion_takes_the_farthest_each_time():
    points = np.random.default_rng(1).normal(size=(200, 3))
    chosen, dispersion = low_dispersion(points, 30)
    for count in (1, 5, 29):
        away = np.linalg.norm(points[:, None] - points[chosen[:count]][None], axis=2).min(axis=1)
        assert away[chosen[count]] == pytest.approx(away.max())
        assert dispersion[count - 1] == pytest.approx(away.max())
    assert len(set(chosen)) == 30
    with pytest.raises(BadInput, match="201 samples"):
        low_dispersion(points, 201)


def test_orientations_stay_in_their_cone():
    turns = orientations(500, 75.0, np.random.default_rng(1))
    assert np.allclose(turns @ turns.swapaxes(1, 2), np.eye(3), atol=1e-12)
    assert np.allclose(np.linalg.det(turns), 1.0)
    away = np.degrees(np.arccos(-turns[:, 1, 0]))
    assert 65 < away.max() <= 75.0


def test_an_entry_is_what_a_camera_sees_of_its_hand(database: PoseDatabase):
    camera = Camera(VIEW_PX, VIEW_PX, (VIEW_FOCAL_PX, VIEW_FOCAL_PX), (MIDDLE, MIDDLE))
    for entry in (0, 700, 1499):
        seen = rasterise(posed(SKIN, database.state(entry)), SKIN.triangles, camera)
        patches, window = seen.painted(PATTERN.patch), database.window(entry)
        for patch in np.unique(patches[patches > 0]):
            v, u = np.nonzero(patches == patch)
            expected = window.to_tiny(np.array([u.mean(), v.mean()]))
            assert np.allclose(database.centroids[entry, patch - 1], expected, atol=1e-4)
        hidden = np.setdiff1d(np.arange(1, 21), patches) - 1
        assert np.isnan(database.centroids[entry, hidden]).all()
        assert database.areas[entry].sum() > 150
        again = rendered_views(SKIN, PATTERN, database.angles_deg[[entry]], database.rotations[[entry]])
        assert np.array_equal(again["tiny"][0], database.tiny[entry])


def test_it_is_mapped_when_it_is_there_and_built_anew_when_damaged(database: PoseDatabase, tmp_path: Path):
    poses, settings = generated_poses(100), DatabaseSettings(entries=20, configurations=10)
    first = pose_database(SKIN, PATTERN, poses, tmp_path, settings, workers=1)
    said: list[str] = []
    again = pose_database(
        SKIN, PATTERN, poses, tmp_path, settings, workers=1, report=lambda sentence, _: said.append(sentence)
    )
    assert said == ["20 entries"]
    assert isinstance(again.transforms, np.memmap)
    assert not again.tiny.flags.writeable
    tiny = np.array(first.tiny)
    (first.folder / "tiny.npy").write_bytes(b"cut")
    assert np.array_equal(pose_database(SKIN, PATTERN, poses, tmp_path, settings, workers=1).tiny, tiny)
    assert [path.name for path in tmp_path.iterdir()] == [first.folder.name]
    other = pose_database(SKIN, PATTERN, poses + 0.1, tmp_path, settings, workers=1)
    assert other.folder != first.folder


def test_two_processes_build_what_one_builds(tmp_path: Path):
    poses, settings = generated_poses(100), DatabaseSettings(entries=600, configurations=20)
    one = pose_database(SKIN, PATTERN, poses, tmp_path / "one", settings, workers=1)
    two = pose_database(SKIN, PATTERN, poses, tmp_path / "two", settings, workers=2)
    for name in ("tiny", "transforms", "areas", "windows", "rotations"):
        assert np.array_equal(getattr(one, name), getattr(two, name))


def test_databases_have_a_limit_together_and_leave_room_on_the_disk(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """A database that nobody used for longest goes first; one that does not fit is not begun."""
    monkeypatch.setattr(made, "MOST_DATABASE_BYTES", 3.5 * 20 * made.ENTRY_BYTES)
    poses, found = generated_poses(50), []
    for seed in range(4):
        settings = DatabaseSettings(20, seed=seed)
        found.append(pose_database(SKIN, PATTERN, poses, tmp_path, settings, workers=1).folder)
        os.utime(found[-1], (1e9 + seed, 1e9 + seed))
    assert [place.exists() for place in found] == [False, True, True, True]
    free = shutil.disk_usage(tmp_path).free
    monkeypatch.setattr(made, "ENTRY_BYTES", free)
    monkeypatch.setattr(made, "MOST_DATABASE_BYTES", 100 * free)
    with pytest.raises(BadInput, match=r"takes .* GB, and .* free some disk space, or ask for fewer entries"):
        pose_database(SKIN, PATTERN, poses, tmp_path, DatabaseSettings(20, seed=9), workers=1)
    assert sorted(tmp_path.iterdir()) == sorted(found[1:])


def test_cancelled_it_leaves_nothing(tmp_path: Path):
    with pytest.raises(Cancelled):
        pose_database(
            SKIN, PATTERN, generated_poses(50), tmp_path, DatabaseSettings(entries=50), cancelled=lambda: True
        )
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    "wrong",
    [{"entries": 0}, {"configurations": 0}, {"cone_deg": 200.0}, {"sampling": "any"}, {"entries": 10**9}],
)
def test_no_database_is_refused(wrong):
    with pytest.raises(BadInput):
        DatabaseSettings(**wrong)
