"""What both refinements rest on: motions of points and of boundaries, against finite differences."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from glovecal_models.colour_glove.camera_model import Camera
from glovecal_models.colour_glove.crop import Window
from glovecal_models.colour_glove.hand_state import DEGREES_OF_FREEDOM, RANGE_DEG, HandState
from glovecal_models.colour_glove.pattern import glove_pattern
from glovecal_models.colour_glove.pose.centroid_ik import correspondences, drawn_patches
from glovecal_models.colour_glove.pose.dense import label_equations, refine_by_labels
from glovecal_models.colour_glove.pose.window_step import Belief, damped_step, pixel_motion
from glovecal_models.colour_glove.pose.window_view import (
    DRAWN_POINTS,
    SEEN_POINTS,
    PrintedHand,
    WindowView,
    colour_shares,
)
from glovecal_models.colour_glove.rasterise import rasterise, z_buffer
from glovecal_models.colour_glove.skin import hand_skin, posed
from glovecal_models.hand.skeleton import hand_skeleton

SKIN = hand_skin()
HAND = PrintedHand(SKIN, glove_pattern(SKIN))
PLAIN = Camera()
BESIDE = Camera(
    distortion=(-0.12, 0.05, 0.001, -0.002, 0.01),
    rotation=tuple(map(tuple, Rotation.from_rotvec([0.1, 0.4, 0.05]).as_matrix())),
    translation_mm=(-160.0, 20.0, 30.0),
)
FACING = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
"""Fingers up in the picture, the back of the hand away from the camera."""


def state(seed: int) -> HandState:
    rng = np.random.default_rng(seed)
    turn = Rotation.from_rotvec(rng.normal(0.0, 0.4, 3)).as_matrix() @ FACING
    return HandState(rng.uniform(*(0.6 * RANGE_DEG).T), turn, np.array([0.0, 80.0, 450.0]))


def view(truth: HandState, camera: Camera = PLAIN) -> WindowView:
    labels = rasterise(posed(SKIN, truth), SKIN.triangles, camera).painted(HAND.pattern.colour)
    v, u = np.nonzero(labels)
    half = 0.6 * max(np.ptp(u), np.ptp(v))
    return WindowView.of(labels, Window(float(u.mean()), float(v.mean()), float(half)), camera)


@pytest.mark.parametrize("side", ["right", "left"])
def test_points_move_as_finite_differences_say(side):
    skin = hand_skin(hand_skeleton(hand=side))
    here, vertices = state(3), np.arange(0, len(skin.vertices_mm), 211)
    found = pixel_motion(skin, here, vertices, posed(skin, here)[vertices], BESIDE)
    for degree in range(DEGREES_OF_FREEDOM):
        step = 1e-4 * np.eye(DEGREES_OF_FREEDOM)[degree]
        ahead, behind = (BESIDE.project(posed(skin, here.moved(sign * step))[vertices]) for sign in (1, -1))
        assert np.allclose(found[:, :, degree], (ahead - behind) / 2e-4, atol=1e-5)


@pytest.mark.parametrize("side", ["right", "left"])
def test_what_faces_away_from_the_camera_is_hidden_anyway(side):
    skin = hand_skin(hand_skeleton(hand=side))
    placed = posed(skin, state(2))
    pixels = PLAIN.project(placed)
    all_of_them, _ = z_buffer(pixels, placed[:, 2], skin.triangles, 480, 640)
    fronts, _ = z_buffer(pixels, placed[:, 2], skin.triangles, 480, 640, True)
    assert np.count_nonzero(all_of_them >= 0) > 15_000
    assert np.count_nonzero(fronts != all_of_them) < 10


@settings(max_examples=20)
@given(st.integers(0, 10_000))
def test_a_turn_and_its_vector_are_scipys(seed):
    rng = np.random.default_rng(seed)
    vector = rng.normal(size=3) * 10.0 ** rng.uniform(-9.0, 0.4)
    step = np.concatenate([np.zeros(20), np.degrees(vector), np.zeros(3)])
    here = state(seed)
    expected = Rotation.from_rotvec(vector).as_matrix() @ here.rotation
    assert np.allclose(here.moved(step).rotation, expected, atol=1e-12)
    back = Rotation.from_matrix(expected @ here.rotation.T).as_rotvec(degrees=True)
    assert np.allclose(here.moved(step).step_from(here)[20:23], back, atol=1e-6)


@settings(max_examples=20)
@given(st.integers(0, 10_000))
def test_a_step_leads_from_one_state_to_the_other(seed):
    first, second = state(seed), state(seed + 1)
    reached = first.moved(second.step_from(first))
    assert np.allclose(reached.vector(), second.vector(), atol=1e-9)


def test_the_kernel_projects_as_the_camera():
    points = np.random.default_rng(1).uniform((-200, -200, 200), (200, 200, 900), (50, 3))
    seen = replace(view(state(1)), camera=BESIDE)
    pixels, depth = seen.projected(points)
    assert np.allclose(pixels, BESIDE.project(points))
    assert np.allclose(depth, BESIDE.from_outside(points)[:, 2])


def test_shares_of_a_cell_add_up_to_one():
    seen = view(state(2))
    for blurs in (0, 1, 2):
        shares = colour_shares(seen.labels, np.arange(11, dtype=np.uint8), 11, SEEN_POINTS, blurs)
        assert np.allclose(shares.sum(axis=2), 1.0, atol=1e-5)
    by_pixels = colour_shares(seen.labels, np.arange(11, dtype=np.uint8), 11, SEEN_POINTS, 1)
    drawn = colour_shares(seen.drawn(HAND, state(2)), HAND.colour_of, 11, 3, 1)
    assert np.abs(drawn - by_pixels).mean() < 0.004  # one hand, once by pixels, once by points


def test_boundaries_move_as_drawings_do():
    """The analytic derivative of all shares against drawings a visible step apart."""
    from glovecal_models.colour_glove.pose.dense import _Drawn

    for seed in (4, 5):
        here = state(seed)
        seen = view(here)

        def drawn(moved: HandState, seen: WindowView = seen) -> _Drawn:
            return _Drawn(HAND, seen, posed(SKIN, moved), 11, 1)

        jacobian = drawn(here).jacobian(here)
        compared = 0
        for degree in range(DEGREES_OF_FREEDOM):
            size = 12.0 if degree == 25 else 4.0
            step = size * np.eye(DEGREES_OF_FREEDOM)[degree]
            ahead, behind = (drawn(here.moved(sign * step)).shares.ravel() for sign in (1, -1))
            expected, found = (ahead - behind) / (2 * size), jacobian[:, degree]
            if np.linalg.norm(expected) < 0.1:  # nearly hidden: single points come and go
                continue
            compared += 1
            alike = expected @ found / np.linalg.norm(expected) / np.linalg.norm(found)
            assert alike > 0.85, f"degree {degree}"
            assert 0.7 < expected @ found / (expected @ expected) < 1.3, f"degree {degree}"
        assert compared > 10


def test_centroids_and_areas_move_as_drawings_do():
    """Their analytic derivatives against drawings a visible step apart: partly hidden patches too."""
    for seed in (4, 5):
        here = state(seed)
        seen = view(here)

        def patches(moved: HandState, seen: WindowView = seen) -> np.ndarray:
            return drawn_patches(seen.shown(HAND, posed(SKIN, moved)), HAND.patch_of, 20)[0]

        found = correspondences(HAND, seen, here, 0.15)
        assert len(found.patches) > 10
        assert np.abs(found.log_area).max() < 0.5  # one hand, once by pixels, once by points
        expected, told = [], []
        for degree in range(DEGREES_OF_FREEDOM):
            size = 12.0 if degree == 25 else 4.0
            step = size * np.eye(DEGREES_OF_FREEDOM)[degree]
            ahead, behind = (patches(here.moved(sign * step))[found.patches] for sign in (1, -1))
            apart = ahead[:, 1:] / ahead[:, :1] - behind[:, 1:] / behind[:, :1]
            pixels = apart * seen.cell_px / DRAWN_POINTS / (2 * size)
            growth = np.log(ahead[:, 0] / behind[:, 0]) / (2 * size)
            # In radii of a patch, so that both count alike.
            radius = np.sqrt(patches(here)[found.patches, 0] / np.pi) * seen.cell_px / DRAWN_POINTS
            expected.append(np.append(pixels / radius[:, None], growth))
            told.append(np.append(found.motion_px[:, :, degree] / radius[:, None], found.growth[:, degree]))
        alike = [np.corrcoef(one, other)[0, 1] for one, other in zip(expected, told, strict=True)]
        assert np.median(alike) > 0.9  # where a patch is nearly hidden, single points come and go
        slope = np.sum(np.multiply(expected, told)) / np.sum(np.square(expected))
        assert 0.8 < slope < 1.2


def test_a_step_stays_within_a_hands_range_and_follows_the_tighter_belief():
    here = state(6)
    far = HandState(here.angles_deg + 500.0, here.rotation, here.position_mm)
    loose, tight = (Belief(s, v * np.eye(DEGREES_OF_FREEDOM)) for s, v in ((far, 400.0), (here, 4.0)))
    nothing = np.zeros((DEGREES_OF_FREEDOM, DEGREES_OF_FREEDOM))
    moved = damped_step(here, (loose, tight), nothing, nothing[0], 0.0)
    assert (moved.angles_deg >= RANGE_DEG[:, 0]).all()
    assert (moved.angles_deg <= RANGE_DEG[:, 1]).all()
    middle = damped_step(here, (Belief(state(7), 1e-6 * np.eye(26)), tight), nothing, nothing[0], 0.0)
    near = state(7).step_from(here)
    assert np.abs(middle.step_from(here)[:20] - np.clip(near[:20], -28, 28)).max() < 0.5


def test_labels_lead_back_to_the_truth():
    truth = state(8)
    off = truth.moved(np.random.default_rng(8).normal(0.0, 1.0, 26) * ([5.0] * 20 + [3.0] * 3 + [6.0] * 3))
    start = off.within_range()
    loose = Belief(start, np.diag([20.0] * 20 + [10.0] * 3 + [30.0] * 3) ** 2)
    views = [view(truth), view(truth, BESIDE)]
    found = refine_by_labels(HAND, views, start, (loose,))
    before, after = (np.abs(s.step_from(truth)) for s in (start, found.state))
    assert after[20:23].max() < 1.0
    assert after[23:].max() < 2.0
    assert after[:20].mean() < 0.5 * before[:20].mean()
    information = label_equations(HAND, views, truth)
    assert np.allclose(information, information.T, rtol=1e-3, atol=1e-2)


def test_an_arm_that_hides_the_cuff_moves_nothing():
    truth = state(8)
    whole = view(truth)
    shown = whole.shown(HAND, posed(SKIN, truth))
    hidden = np.where(HAND.is_cuff[shown].repeat(2, axis=0).repeat(2, axis=1), np.uint8(0), whole.labels)
    assert np.count_nonzero(hidden != whole.labels) > 200
    seen = replace(whole, labels=hidden)
    assert np.array_equal(seen.seen_beside(HAND, shown) > 0, whole.seen_beside(HAND, shown) > 0)
    off = truth.moved(np.random.default_rng(9).normal(0.0, 1.0, 26) * ([4.0] * 20 + [3.0] * 3 + [5.0] * 3))
    wide = (Belief(off, np.diag([100.0] * 20 + [25.0] * 3 + [100.0] * 3)),)
    errors = [
        np.abs(truth.step_from(refine_by_labels(HAND, [each], off, wide).state)) for each in (whole, seen)
    ]
    assert errors[1][:20].mean() < 1.5 * errors[0][:20].mean() + 0.5
    assert errors[1][25] < errors[0][25] + 5.0
