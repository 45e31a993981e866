"""The chain on rendered hands: stages, two cameras, following, and deviations that are true."""

from pathlib import Path

import numpy as np
import pytest

from glovecal_models.colour_glove.camera_model import Camera
from glovecal_models.colour_glove.database import PoseDatabase
from glovecal_models.colour_glove.lookup import PoseLookup, pca_code
from glovecal_models.colour_glove.pattern import glove_pattern
from glovecal_models.colour_glove.photograph import hand_motion
from glovecal_models.colour_glove.pose.error_learning import (
    PEOPLE,
    ShapeSpread,
    errors_file,
    learned_errors,
    other_hand,
    spoilt,
)
from glovecal_models.colour_glove.pose.hand_tracker import HandTracker, LearnedErrors, fitted_scale
from glovecal_models.colour_glove.pose.window_view import PrintedHand
from glovecal_models.colour_glove.rasterise import rasterise
from glovecal_models.colour_glove.skin import HandSkin, hand_skin, posed
from glovecal_models.errors import BadInput, Cancelled

SKIN = hand_skin()
HAND = PrintedHand(SKIN, glove_pattern(SKIN))
AHEAD = np.array([0.0, 0.0, 470.0])
_SIDEWAYS = np.array([[0.5, 0.0, -0.866], [0.0, 1.0, 0.0], [0.866, 0.0, 0.5]])
_TURN = np.linalg.svd(_SIDEWAYS)[0] @ np.linalg.svd(_SIDEWAYS)[2]
CAMERAS = (
    Camera(),
    Camera(rotation=tuple(map(tuple, _TURN)), translation_mm=tuple(AHEAD - _TURN @ AHEAD)),
)
EMPTY = np.zeros((480, 640), np.uint8)


@pytest.fixture(scope="module")
def lookup(database: PoseDatabase) -> PoseLookup:
    return PoseLookup(database, pca_code(database.transforms))


@pytest.fixture(scope="module")
def errors(lookup: PoseLookup) -> LearnedErrors:
    return learned_errors(HAND, lookup, CAMERAS[:1], clips=3, workers=1)


def pictures(skin: HandSkin, state, rng: np.random.Generator) -> list[np.ndarray]:
    placed = posed(skin, state)
    drawn = [rasterise(placed, skin.triangles, camera).painted(HAND.pattern.colour) for camera in CAMERAS]
    return [spoilt(labels, rng) for labels in drawn]


@pytest.fixture(scope="module")
def moment():
    """Eight hands that are not the model's, half a second and more apart."""
    states = hand_motion(other_hand(SKIN, 70), 8.0, 1.0, seed=71)[:8]
    rng = np.random.default_rng(72)
    return [(state, pictures(other_hand(SKIN, 70), state, rng)) for state in states]


def mean_errors(lookup, errors, moment, stage: str, cameras: int = 1) -> np.ndarray:
    """Joints (degrees), turn (degrees), depth (mm)."""
    learned = errors
    tracker = HandTracker(HAND, lookup, CAMERAS[:cameras], learned, stage=stage, follows=False)
    rows = []
    for index, (state, views) in enumerate(moment):
        found = tracker.track(views[:cameras], float(index))
        assert found is not None
        assert found.stage == stage
        step = np.abs(state.step_from(found.state))
        rows.append([step[:20].mean(), step[20:23].mean(), step[25]])
    return np.mean(rows, axis=0)


def test_each_stage_errs_less_than_the_one_before(lookup, errors, moment):
    rows = {
        stage: mean_errors(lookup, errors, moment, stage) for stage in ("nearest", "blend", "ik", "dense")
    }
    assert rows["nearest"][0] > rows["blend"][0] > rows["ik"][0] > rows["dense"][0]
    assert rows["ik"][1] < 0.7 * rows["blend"][1]
    assert rows["dense"][1] < rows["ik"][1]


def test_a_second_camera_settles_the_depth(lookup, errors, moment):
    one, two = (mean_errors(lookup, errors, moment, "dense", cameras) for cameras in (1, 2))
    assert two[2] < 0.5 * one[2]
    assert two[0] < one[0]


def test_pictures_without_a_glove_have_no_pose(lookup, errors, moment):
    tracker = HandTracker(HAND, lookup, CAMERAS, errors)
    assert tracker.track([EMPTY, EMPTY], 0.0) is None
    views = moment[0][1]
    found = tracker.track([views[0], EMPTY], 1.0)
    assert found is not None
    assert found.patches
    assert set(found.patches) <= set(range(1, 21))
    assert 0.0 <= found.disagreeing <= 1.0


def test_what_cannot_be_tracked_is_refused(lookup, errors):
    with pytest.raises(BadInput, match="stage 'best'"):
        HandTracker(HAND, lookup, CAMERAS, errors, stage="best")
    with pytest.raises(BadInput, match="at least one camera"):
        HandTracker(HAND, lookup, (), errors)
    tracker = HandTracker(HAND, lookup, CAMERAS, errors)
    with pytest.raises(BadInput, match="1 pictures of 2 cameras"):
        tracker.track([EMPTY], 0.0)
    with pytest.raises(BadInput, match="label image"):
        tracker.track([EMPTY.astype(float), EMPTY], 0.0)


def test_following_steadies_and_a_gap_is_forgotten(lookup, errors):
    skin, rng = other_hand(SKIN, 80), np.random.default_rng(81)
    states = hand_motion(skin, 0.8, 30.0, seed=82)
    clip = [pictures(skin, state, rng)[:1] for state in states]

    def jitter_and_error(follows: bool) -> tuple[float, float]:
        tracker = HandTracker(HAND, lookup, CAMERAS[:1], errors, stage="ik", follows=follows)
        steps = []
        for index, (state, views) in enumerate(zip(states, clip, strict=True)):
            found = tracker.track(views, index / 30.0)
            assert found is not None
            steps.append(found.state.step_from(state)[:20])
        wrong = np.array(steps)
        return float(np.abs(np.diff(wrong, axis=0)).mean()), float(np.abs(wrong).mean())

    jumpy, steady = jitter_and_error(False), jitter_and_error(True)
    assert steady[0] < 0.8 * jumpy[0]
    assert steady[1] < 1.3 * jumpy[1]
    tracker = HandTracker(HAND, lookup, CAMERAS[:1], errors, stage="ik")
    first = tracker.track(clip[0], 0.0)
    tracker.track(clip[1], 1 / 30.0)
    later = tracker.track(clip[0], 5.0)
    assert first is not None
    assert later is not None
    assert np.array_equal(first.state.vector(), later.state.vector())


def test_learned_errors_are_kept_and_wrong_files_refused(errors: LearnedErrors, tmp_path: Path, lookup):
    errors.save(tmp_path / "errors.npz")
    again = LearnedErrors.load(tmp_path / "errors.npz")
    assert np.array_equal(again.blend_covariance, errors.blend_covariance)
    assert all(np.array_equal(again.scales[name], scale) for name, scale in errors.scales.items())
    assert learned_errors(HAND, lookup, CAMERAS[:1], clips=3, workers=1).speed == pytest.approx(errors.speed)
    (tmp_path / "half.npz").write_bytes((tmp_path / "errors.npz").read_bytes()[:500])
    (tmp_path / "words.npz").write_text("no numbers")
    for name in ("half.npz", "words.npz"):
        with pytest.raises(BadInput, match="holds no errors"):
            LearnedErrors.load(tmp_path / name)
    with pytest.raises(BadInput, match="were never learned"):
        LearnedErrors(errors.blend_covariance, errors.speed, {}).deviation("ik", False, np.ones(26), 0.1)
    with pytest.raises(Cancelled):
        learned_errors(HAND, lookup, CAMERAS, clips=5, workers=1, cancelled=lambda: True)


def test_a_fitted_shape_has_errors_of_its_own(lookup):
    """Its bones are better known than people's; radii gain as much, the size counts apart."""
    left = ShapeSpread.after_fit(0.004, [0.011, 0.016])
    assert left.bones == pytest.approx(np.sqrt(np.mean([0.011**2, 0.016**2]) - 0.004**2))
    assert left.radii / left.bones == pytest.approx(PEOPLE.radii / PEOPLE.bones)
    assert left.overall == 0.004
    assert ShapeSpread.after_fit(0.05, [0.049]).bones == 0.0
    usual = errors_file(HAND, lookup, CAMERAS, 3)
    assert (
        errors_file(HAND, lookup, CAMERAS, 3, left) != usual == errors_file(HAND, lookup, CAMERAS, 3, PEOPLE)
    )


def test_a_scale_is_found_again():
    rng = np.random.default_rng(3)
    posterior, share = rng.lognormal(0.5, 0.6, (4000, 26)), rng.uniform(0.05, 0.6, 4000)
    true = np.array([1.0, 0.8, 0.5])
    sd = np.exp(true[0] + true[1] * np.log(posterior) + true[2] * np.log(share + 0.02)[:, None])
    assert np.allclose(fitted_scale(sd * rng.normal(size=sd.shape), posterior, share), true, atol=0.15)
    with pytest.raises(BadInput, match="at least 30"):
        fitted_scale(np.ones((5, 26)), np.ones((5, 26)), np.ones(5))
