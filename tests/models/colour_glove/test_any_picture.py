"""The same scene at any resolution, turned by quarters of a circle, and mirrored."""

from dataclasses import replace

import numpy as np
import pytest
from lamplight import Scene, at, lit_picture, taken, turned

from glovecal_models.colour_glove.camera_model import Camera
from glovecal_models.colour_glove.database import PoseDatabase
from glovecal_models.colour_glove.hand_state import HandState
from glovecal_models.colour_glove.lookup import PoseLookup, pca_code
from glovecal_models.colour_glove.pattern import glove_pattern
from glovecal_models.colour_glove.photograph import hand_motion
from glovecal_models.colour_glove.pictures.classify import drawn_colours
from glovecal_models.colour_glove.pictures.picture_check import STRANGE_PX2, PictureCheck, Sighting
from glovecal_models.colour_glove.pose.hand_tracker import HandTracker, shipped_errors
from glovecal_models.colour_glove.pose.window_view import PrintedHand
from glovecal_models.colour_glove.rasterise import rasterise
from glovecal_models.colour_glove.skin import hand_skin, posed
from glovecal_service.camera.tracking_setup import at_working_size, working_size

SKIN = hand_skin()
PATTERN = glove_pattern(SKIN)
HANDS = [at(SKIN, state, 0.0, 0.0, 480.0) for state in hand_motion(SKIN, 16.0, 0.5, seed=71, cone_deg=40.0)]


@pytest.fixture(scope="module")
def lookup(database: PoseDatabase) -> PoseLookup:
    return PoseLookup(database, pca_code(database.transforms))


def camera(width: int, height: int) -> Camera:
    focal = 533.0 * max(width, height) / 640
    return Camera(width, height, (focal, focal), ((width - 1) / 2, (height - 1) / 2))


def labels_of(state, view: Camera) -> np.ndarray:
    return rasterise(posed(SKIN, state), SKIN.triangles, view).painted(PATTERN.colour)


@pytest.mark.parametrize(
    ("size", "looked_at"),
    [
        ((320, 240), (320, 240)), ((640, 480), (640, 480)), ((854, 480), (640, 360)),
        ((1280, 720), (640, 360)), ((1920, 1080), (640, 360)), ((1080, 1920), (360, 640)),
        ((3840, 2160), (640, 360)), ((4000, 3000), (640, 480)), ((9000, 1), (640, 1)),
    ],
)  # fmt: skip
def test_larger_pictures_are_looked_at_at_640_pixels(size, looked_at):
    assert working_size(*size) == looked_at
    pixels = np.random.default_rng(1).integers(0, 256, (size[1], size[0], 3), dtype=np.uint8)
    seen = at_working_size(pixels)
    assert seen.shape == (looked_at[1], looked_at[0], 3)
    assert abs(float(seen.mean()) - float(pixels.mean())) < 2.0
    np.testing.assert_array_equal(at_working_size(pixels, mirrored=True), seen[:, ::-1])
    labels = at_working_size(pixels[..., 0] % 11)
    assert labels.shape == seen.shape[:2]
    assert labels.max() <= 10


@pytest.mark.parametrize("size", [(1366, 768), (1920, 1080), (1080, 1920)])
def test_a_resized_camera_sees_the_same(size):
    width, height = size
    lens, centre = (-0.1, 0.04, 1e-3, 5e-4, 0.0), (width / 2 + 9, height / 2 - 7)
    fine = Camera(width, height, (1500.0, 1480.0), centre, lens)
    coarse = fine.resized(*working_size(width, height))
    points = np.random.default_rng(2).normal(0, 60, (50, 3)) + np.array([0.0, 0.0, 500.0])
    share = np.array([coarse.width / fine.width, coarse.height / fine.height])
    np.testing.assert_allclose(coarse.project(points), (fine.project(points) + 0.5) * share - 0.5)


@pytest.mark.parametrize("quarter_turns", [1, 2, 3])
def test_a_turned_picture_gives_the_turned_hand(lookup, quarter_turns):
    upright, on_side = camera(640, 480), camera(480, 640) if quarter_turns % 2 else camera(640, 480)
    compared = 0
    for state in HANDS:
        labels = labels_of(state, upright)
        there = turned(state, -quarter_turns)
        seen = Sighting.of(labels, lookup)
        other = Sighting.of(np.ascontiguousarray(np.rot90(labels, quarter_turns)), lookup)
        assert seen is not None
        assert other is not None
        if seen.neighbours.quarter_turns or other.neighbours.quarter_turns != 4 - quarter_turns:
            # A hand that lies on its side is near to the database either way.
            assert max(seen.distance_px2, other.distance_px2) <= STRANGE_PX2
            continue
        compared += 1
        np.testing.assert_array_equal(other.neighbours.entries, seen.neighbours.entries)
        first = lookup.placed(seen.neighbours, seen.window, upright)
        found = lookup.placed(other.neighbours, other.window, on_side)
        np.testing.assert_allclose(found.angles_deg, first.angles_deg, atol=1e-6)
        expected = turned(first, -quarter_turns)
        np.testing.assert_allclose(found.rotation, expected.rotation, atol=1e-3)
        np.testing.assert_allclose(found.position_mm, expected.position_mm, atol=0.5)
        apart = np.degrees(np.arccos((np.trace(found.rotation @ there.rotation.T) - 1) / 2))
        assert apart < 60
    assert compared


def test_a_mirrored_picture_is_told_with_its_remedy(lookup):
    check, told = PictureCheck(lookup), []
    grey = np.full((480, 640, 3), 200, np.uint8)
    for state in HANDS:
        mirrored = np.ascontiguousarray(labels_of(state, camera(640, 480))[:, ::-1])
        told += check.findings(grey, mirrored)
    assert len(told) >= 0.75 * len(HANDS)
    for finding in told:
        assert finding.kind == "mirrored"
        assert "--mirrored" in finding.sentence


def test_one_scene_has_the_same_colours_and_angles_from_640_pixels_to_4k(lookup):
    """By two cameras: of one, differences are those that a pose which the picture leaves open makes."""
    colours, small, turn = drawn_colours(SKIN, PATTERN), camera(640, 360), from_aside()
    shift = (turn @ [0.0, 0.0, -480.0]) + [0.0, 0.0, 480.0]
    aside = replace(small, rotation=tuple(map(tuple, turn.tolist())), translation_mm=tuple(shift.tolist()))
    scene = Scene(5, "soft", "plain", jpeg=88)
    there = HandState(HANDS[0].angles_deg, turn @ HANDS[0].rotation, turn @ HANDS[0].position_mm + shift)
    light = [lit_picture(scene, SKIN, PATTERN, camera(3840, 2160), [state])[0] for state in (HANDS[0], there)]
    seen = [
        [colours.labels(at_working_size(taken(scene, each, width))) for each in light]
        for width in (640, 3840)
    ]
    for coarse, fine in zip(*seen, strict=True):
        glove = coarse > 0
        assert glove.sum() > 5000
        assert np.mean(fine[glove] == coarse[glove]) > 0.96
        assert np.count_nonzero(fine) == pytest.approx(glove.sum(), rel=0.03)
    hand, errors = PrintedHand(SKIN, PATTERN), shipped_errors(2, "right")
    poses = [HandTracker(hand, lookup, (small, aside), errors).track(labels, 0.0) for labels in seen]
    coarse, fine = (pose.state.angles_deg for pose in poses if pose is not None)
    assert np.median(np.abs(fine - coarse)) < 1.0, np.round(fine - coarse, 1)
    assert np.sqrt(np.mean(np.square(fine - coarse))) < 1.5, np.round(fine - coarse, 1)


def from_aside() -> np.ndarray:
    """Turns what is seen as from 60 degrees aside."""
    cosine, sine = np.cos(np.radians(60.0)), np.sin(np.radians(60.0))
    return np.array([[cosine, 0.0, -sine], [0.0, 1.0, 0.0], [sine, 0.0, cosine]])
