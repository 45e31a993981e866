"""The chain on rendered hands: stages, two cameras, following, and deviations that are true."""

from pathlib import Path

import numpy as np
import pytest
from error_learning import learned_errors
from other_gloves import displaced, other_hand

from glovecal_models.colour_glove.camera_model import Camera
from glovecal_models.colour_glove.database import PoseDatabase
from glovecal_models.colour_glove.hand_shape import HandShape
from glovecal_models.colour_glove.hand_state import STAGES
from glovecal_models.colour_glove.lookup import PoseLookup, pca_code
from glovecal_models.colour_glove.pattern import glove_pattern
from glovecal_models.colour_glove.photograph import hand_motion
from glovecal_models.colour_glove.pose.both_ways import AHEAD, AT_ONCE, followed_both_ways
from glovecal_models.colour_glove.pose.hand_tracker import (
    EVIDENCE,
    HandTracker,
    LearnedErrors,
    fitted_scale,
    scale_name,
    shipped_errors,
    with_shape,
)
from glovecal_models.colour_glove.pose.window_view import PrintedHand
from glovecal_models.colour_glove.rasterise import rasterise
from glovecal_models.colour_glove.skin import RADII_MM, HandSkin, hand_skin, posed
from glovecal_models.errors import BadInput, Cancelled
from glovecal_models.hand.skeleton import hand_skeleton

SKIN = hand_skin()
HAND = PrintedHand(SKIN, glove_pattern(SKIN))
MEETING = np.array([0.0, 0.0, 470.0])
_SIDEWAYS = np.array([[0.5, 0.0, -0.866], [0.0, 1.0, 0.0], [0.866, 0.0, 0.5]])
_TURN = np.linalg.svd(_SIDEWAYS)[0] @ np.linalg.svd(_SIDEWAYS)[2]
CAMERAS = (
    Camera(),
    Camera(rotation=tuple(map(tuple, _TURN)), translation_mm=tuple(MEETING - _TURN @ MEETING)),
)
EMPTY = np.zeros((480, 640), np.uint8)


@pytest.fixture(scope="module")
def lookup(database: PoseDatabase) -> PoseLookup:
    return PoseLookup(database, pca_code(database.transforms))


@pytest.fixture(scope="module")
def errors() -> LearnedErrors:
    return shipped_errors(1, "right")


def spoilt(labels: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """With some pixels wrong and some clutter, as from a classifier."""
    found, glove = labels.copy(), labels > 0
    wrong = glove & (rng.random(labels.shape) < 0.04)
    count = int(wrong.sum())
    found[wrong] = np.where(rng.random(count) < 0.7, 0, rng.integers(1, 11, count))
    for _ in range(3):
        v, u, size = rng.integers(0, labels.shape[0]), rng.integers(0, labels.shape[1]), rng.integers(1, 6)
        blob = found[v : v + size, u : u + size]
        blob[blob == 0] = rng.integers(1, 11)
    return found


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


@pytest.mark.slow
def test_errors_are_learned(lookup: PoseLookup) -> None:
    """As for the file that comes with the package, but from three clips."""
    found = learned_errors(HAND, lookup, 1, clips=3, workers=1)
    assert set(found.scales) == {scale_name(stage, False) for stage in STAGES} | {
        scale_name(stage, True) for stage in ("ik", "dense")
    }
    assert np.linalg.eigvalsh(found.blend_covariance).min() > 0.0
    assert all(np.isfinite(scale).all() for scale in found.scales.values())
    with pytest.raises(Cancelled):
        learned_errors(HAND, lookup, 1, clips=5, workers=1, cancelled=lambda: True)


def test_errors_are_read_as_they_were_written_and_wrong_files_refused(tmp_path: Path) -> None:
    found = shipped_errors(2, "right")
    arrays = {f"these: {name}": array for name, array in found.arrays().items()}
    np.savez(tmp_path / "errors.npz", allow_pickle=False, **arrays)
    again = LearnedErrors.load(tmp_path / "errors.npz", "these: ")
    assert np.array_equal(again.blend_covariance, found.blend_covariance)
    assert all(np.array_equal(again.scales[name], scale) for name, scale in found.scales.items())
    (tmp_path / "half.npz").write_bytes((tmp_path / "errors.npz").read_bytes()[:500])
    (tmp_path / "words.npz").write_text("no numbers")
    for name in ("half.npz", "words.npz", "errors.npz"):
        with pytest.raises(BadInput, match="holds no errors"):
            LearnedErrors.load(tmp_path / name)
    evidence = np.zeros((26, len(EVIDENCE)))
    with pytest.raises(BadInput, match="were never learned"):
        LearnedErrors(found.blend_covariance, found.speed, {}).deviation("ik", False, evidence)


@pytest.mark.parametrize("cameras", [1, 2, 3])
def test_what_was_learned_comes_with_the_package(cameras: int) -> None:
    right, left = (shipped_errors(cameras, hand) for hand in ("right", "left"))
    assert set(right.scales) >= {scale_name("dense", True), "nearest", "blend"}
    assert np.linalg.eigvalsh(right.blend_covariance).min() > 0.0
    assert np.array_equal(np.diag(left.blend_covariance), np.diag(right.blend_covariance))
    mirrored = left.blend_covariance[:20, 21]
    assert np.array_equal(mirrored, -right.blend_covariance[:20, 21])


def test_less_is_stated_of_a_hand_whose_shape_was_fitted(lookup) -> None:
    """By two cameras, where as much disagrees; both hands."""
    evidence = np.ones((26, len(EVIDENCE)))
    evidence[:, 1:] = np.log([2.0, 0.2, 0.3, 3.0, 15.0])
    for side in ("right", "left"):
        skin = hand_skin(hand_skeleton(hand=side))
        before = HandTracker(PrintedHand(skin, HAND.pattern), lookup, CAMERAS, shipped_errors(2, side))
        shape = fitted_shape_of(skin)
        after = with_shape(before, shape)
        assert np.allclose(after.hand.skin.vertices_mm, skin.vertices_mm)
        assert after.lookup is before.lookup
        stated = [each.errors.deviation("dense", True, evidence)[:20] for each in (before, after)]
        assert stated[1].mean() < 0.8 * stated[0].mean()


def fitted_shape_of(skin: HandSkin) -> HandShape:
    """That of the skin itself."""
    return HandShape(skin.skeleton.hand, skin.skeleton.dimensions.sizes_mm, dict(RADII_MM), {}, {}, 0.02, {})


def test_a_scale_is_found_again() -> None:
    """95 of 100 errors lie within the deviations, whatever goes along with them."""
    rng = np.random.default_rng(3)
    evidence = np.concatenate([np.ones((6000, 26, 1)), rng.normal(0.0, 0.7, (6000, 26, 5))], axis=2)
    true = np.array([1.0, 0.8, 0.5, 0.3, 0.0, -0.2])
    errors = np.exp(evidence @ true) * rng.normal(size=(6000, 26))
    found = fitted_scale(errors[:4000], evidence[:4000])
    assert np.allclose(found, true, atol=0.25)
    sd = np.exp((found * evidence[4000:]).sum(axis=2))
    assert (np.abs(errors[4000:]) <= 1.96 * sd).mean() == pytest.approx(0.955, abs=0.015)
    with pytest.raises(BadInput, match="at least 30"):
        fitted_scale(np.ones((5, 26)), np.ones((5, 26, 6)))


def test_followed_both_ways_knows_no_direction_of_time(lookup, errors) -> None:
    """A film shown backwards gives the same poses backwards: neither trails."""
    skin, rng = other_hand(SKIN, 90), np.random.default_rng(91)
    clip = [pictures(skin, state, rng)[:1] for state in hand_motion(skin, 0.8, 30.0, seed=92)]

    def followed(views) -> list:
        ways = [HandTracker(HAND, lookup, CAMERAS[:1], errors, stage="ik") for _ in range(2)]
        moments = [(view, index / 30.0) for index, view in enumerate(views)]
        return list(followed_both_ways(ways[0], ways[1], moments))

    once, reversed_film = followed(clip), followed(clip[::-1])
    for pose, other in zip(once, reversed(reversed_film), strict=True):
        assert np.allclose(pose.state.angles_deg, other.state.angles_deg, atol=1e-6)
        assert np.allclose(pose.standard_deviation, other.standard_deviation, atol=1e-2)


def test_every_picture_has_its_pose_in_its_place(lookup, errors) -> None:
    """Over the ends of what is held at a time, and where a picture shows nothing."""
    state = hand_motion(SKIN, 1.0, 1.0, seed=5)[0]
    view, count, empty = pictures(SKIN, state, np.random.default_rng(1))[:1], 2 * AT_ONCE + AHEAD + 3, 40
    ways = [HandTracker(HAND, lookup, CAMERAS[:1], errors, stage="blend") for _ in range(2)]
    moments = (([EMPTY] if index == empty else view, index / 30.0) for index in range(count))
    poses = list(followed_both_ways(ways[0], ways[1], moments))
    assert [pose is None for pose in poses] == [index == empty for index in range(count)]


def test_a_displaced_pattern_is_the_printed_one_moved() -> None:
    moved = [displaced(SKIN, HAND.pattern, seed) for seed in range(5)]
    for each in moved:
        assert np.array_equal(each.colour_of_patch, HAND.pattern.colour_of_patch)
        assert 0.01 < (each.patch != HAND.pattern.patch).mean() < 0.3
    assert not np.array_equal(moved[0].patch, moved[1].patch)
