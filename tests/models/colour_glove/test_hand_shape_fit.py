"""A hand's shape from rendered pictures of it: what is found, what stays open, what is refused."""

import numpy as np
import pytest
from other_gloves import other_hand

from glovecal_models.colour_glove.camera_model import Camera
from glovecal_models.colour_glove.database import PoseDatabase
from glovecal_models.colour_glove.lookup import PoseLookup, pca_code
from glovecal_models.colour_glove.pattern import glove_pattern
from glovecal_models.colour_glove.photograph import hand_motion
from glovecal_models.colour_glove.pose.dense import joint_equations, label_equations
from glovecal_models.colour_glove.pose.hand_shape_fit import (
    PARAMETERS,
    FittedShape,
    fitted_hand_shape,
    shaped,
)
from glovecal_models.colour_glove.pose.hand_tracker import HandTracker, LearnedErrors
from glovecal_models.colour_glove.pose.window_view import PrintedHand
from glovecal_models.colour_glove.rasterise import rasterise
from glovecal_models.colour_glove.skin import hand_skin, posed
from glovecal_models.errors import BadInput, Cancelled
from glovecal_models.hand.skeleton import hand_skeleton, mirrored

SKIN = hand_skin()
HAND = PrintedHand(SKIN, glove_pattern(SKIN))
OTHER = other_hand(SKIN, 31)
_TURN = np.array([[0.5, 0.0, -(0.75**0.5)], [0.0, 1.0, 0.0], [0.75**0.5, 0.0, 0.5]])
_AHEAD = np.array([0.0, 0.0, 470.0])
CAMERAS = (
    Camera(),
    Camera(rotation=tuple(map(tuple, _TURN.tolist())), translation_mm=tuple(_AHEAD - _TURN @ _AHEAD)),
)
EMPTY = np.zeros((480, 640), np.uint8)


@pytest.fixture(scope="module")
def tracker(database: PoseDatabase) -> HandTracker:
    """Two cameras; how the look-up errs is assumed, not learned."""
    deviation = np.array([15.0] * 20 + [15.0] * 3 + [20.0, 20.0, 60.0])
    errors = LearnedErrors.as_posterior(np.diag(deviation**2), np.full(26, 60.0))
    return HandTracker(HAND, PoseLookup(database, pca_code(database.transforms)), CAMERAS, errors)


@pytest.fixture(scope="module")
def pictures() -> list[list[np.ndarray]]:
    found = []
    for state in hand_motion(OTHER, 44.0, 0.5, seed=32)[:22]:
        placed = posed(OTHER, state)
        found.append(
            [rasterise(placed, OTHER.triangles, camera).painted(HAND.pattern.colour) for camera in CAMERAS]
        )
    return found


@pytest.fixture(scope="module")
def shape(tracker: HandTracker, pictures: list[list[np.ndarray]]) -> FittedShape:
    return fitted_hand_shape(tracker, pictures, rounds=2)


def relative(sizes_mm) -> np.ndarray:
    """Logarithms of the bones' lengths over those of the true hand."""
    true = OTHER.skeleton.dimensions.sizes_mm
    bones = [name for name in true if name not in ("hand_length", "hand_breadth")]
    return np.array([np.log(sizes_mm[name] / true[name]) for name in bones])


def test_two_cameras_find_the_bones(shape: FittedShape):
    before, after = (relative(sizes) for sizes in (SKIN.skeleton.dimensions.sizes_mm, shape.shape.sizes_mm))
    # Cloth that may lie aside explains a part of what longer bones would.
    assert np.sqrt((after**2).mean()) < 0.8 * np.sqrt((before**2).mean())
    deviations = np.array(list(shape.shape.bones_sd.values()))
    assert np.sqrt(((after / deviations) ** 2).mean()) < 2.0
    assert deviations.max() < 0.05
    assert shape.disagreeing < 0.8 * shape.disagreeing_before
    assert len(shape.used) >= 20


def test_one_camera_leaves_the_size_open(tracker: HandTracker, pictures: list[list[np.ndarray]]):
    alone = HandTracker(HAND, tracker.lookup, CAMERAS[:1], tracker.errors)
    found = fitted_hand_shape(alone, [views[:1] for views in pictures], rounds=1, size_sd=0.05)
    assert found.shape.size_sd > 0.045
    assert abs(found.values[0]) < 0.01


def test_skins_of_another_shape_move_as_the_equations_say():
    """The gradient of half the squared residuals by the shape, against hands drawn a step apart."""
    from glovecal_models.colour_glove.crop import glove_window
    from glovecal_models.colour_glove.pose.dense import _Drawn
    from glovecal_models.colour_glove.pose.window_view import WindowView

    state, values = hand_motion(SKIN, 4.0, 0.5, seed=5)[1], np.zeros(len(PARAMETERS))
    labels = rasterise(posed(SKIN, state), SKIN.triangles, CAMERAS[0]).painted(HAND.pattern.colour)
    window = glove_window(labels)
    assert window is not None
    view, compared = WindowView.of(labels, window, CAMERAS[0]), 0
    for name, size in (
        ("size", 0.06), ("M_proximal", 0.06), ("I_metacarpal radius", 0.06), ("M_proximal around", 2.0),
        ("R_middle along", 2.0),
    ):  # fmt: skip
        step = np.zeros(len(PARAMETERS))
        step[PARAMETERS.index(name)] = size
        less, more = (shaped(SKIN, values + sign * step) for sign in (-1, 1))
        motion = ((posed(more, state) - posed(less, state)) / (2 * size))[:, :, None]
        drawn = [
            _Drawn(PrintedHand(skin, HAND.pattern), view, posed(skin, state), 11, 1).shares.ravel()
            for skin in (less, more)
        ]
        expected = (drawn[1] - drawn[0]) / (2 * size)
        here = _Drawn(HAND, view, posed(SKIN, state), 11, 1)
        found = here.jacobian(state, motion)[:, 0]
        if np.linalg.norm(expected) < 3.0 * 0.06 / size:
            continue
        compared += 1
        assert expected @ found / np.linalg.norm(expected) / np.linalg.norm(found) > 0.8, name
        assert 0.7 < expected @ found / (expected @ expected) < 1.3, name
        hessian, _ = joint_equations(HAND, [view], state, motion)
        assert np.allclose(hessian[:26, :26], label_equations(HAND, [view], state), rtol=1e-3, atol=1e-2)
    assert compared >= 2


def test_a_left_hand_of_a_shape_is_the_right_one_in_a_mirror() -> None:
    values = np.random.default_rng(7).normal(size=len(PARAMETERS)) * 0.5 * np.sqrt(_prior_variance())
    right, left = (shaped(hand_skin(hand_skeleton(hand=side)), values) for side in ("right", "left"))
    assert np.allclose(left.vertices_mm, right.vertices_mm * (1.0, -1.0, 1.0))
    assert left.skeleton == mirrored(right.skeleton)
    assert mirrored(left.skeleton) == right.skeleton
    plain = shaped(SKIN, np.zeros(len(PARAMETERS)))
    assert np.allclose(plain.vertices_mm, SKIN.vertices_mm)
    assert not np.allclose(right.vertices_mm, SKIN.vertices_mm, atol=0.5)
    with pytest.raises(BadInput, match="4 finite numbers"):
        hand_skin(laid_mm={"I_distal": (1.0, float("nan"), 0.0, 0.0)})


def _prior_variance() -> np.ndarray:
    """Of hands about the model's, in the order of ``PARAMETERS``."""
    return np.array(
        [
            4.0 if "axis" in name else 9.0 if name.endswith(("along", "around", "across", "above")) else 2e-3
            for name in PARAMETERS
        ]
    )


def test_too_few_pictures_are_refused(tracker: HandTracker, pictures: list[list[np.ndarray]]):
    with pytest.raises(BadInput, match="2 pictures; the shape needs at least 20"):
        fitted_hand_shape(tracker, pictures[:2])
    with pytest.raises(BadInput, match="2 of 20 pictures show a hand"):
        fitted_hand_shape(tracker, [*pictures[:2], *[[EMPTY, EMPTY]] * 18])
    with pytest.raises(Cancelled):
        fitted_hand_shape(tracker, pictures, cancelled=lambda: True)
