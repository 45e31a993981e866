"""Distances against SciPy and a slow sum, codes against brute force, the crop, and hands found again."""

import numpy as np
import pytest
from boosted_code import BoostedCode, boosted_code
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.ndimage import distance_transform_edt

from glovecal_models.colour_glove.camera_model import Camera
from glovecal_models.colour_glove.crop import (
    CAP,
    Window,
    distance_transform,
    glove_window,
    image_distance,
    tiny_image,
)
from glovecal_models.colour_glove.database import PoseDatabase, orientations, rendered_views
from glovecal_models.colour_glove.hand_state import HandState
from glovecal_models.colour_glove.lookup import Neighbours, PoseLookup, pca_code
from glovecal_models.colour_glove.pattern import glove_pattern
from glovecal_models.colour_glove.pictures.picture_check import Sighting
from glovecal_models.colour_glove.pose_set import generated_poses
from glovecal_models.colour_glove.rasterise import rasterise
from glovecal_models.colour_glove.skin import hand_skin, posed
from glovecal_models.errors import BadInput, Cancelled

SKIN = hand_skin()
PATTERN = glove_pattern(SKIN)


def blocks(seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    image = np.zeros((40, 40), np.uint8)
    for colour in rng.integers(1, 11, 8):
        y, x = rng.integers(0, 40, 2)
        image[y : y + rng.integers(1, 12), x : x + rng.integers(1, 12)] = colour
    return image


@settings(max_examples=40)
@given(st.integers(0, 10_000))
def test_transforms_are_scipys(seed):
    image = blocks(seed)
    found = distance_transform(image)
    for colour in range(1, 11):
        there = image == colour
        exact = (
            np.square(np.asarray(distance_transform_edt(~there)))
            if there.any()
            else np.full((40, 40), np.inf)
        )
        assert np.array_equal(found[colour - 1], np.minimum(np.rint(exact.clip(0, CAP)), CAP))


def slow_distance(first: np.ndarray, second: np.ndarray) -> float:
    def one_way(a: np.ndarray, b: np.ndarray) -> float:
        costs = []
        for y, x in np.argwhere(a):
            same = np.argwhere(b == a[y, x])
            costs.append(min([CAP, *((same - (y, x)) ** 2).sum(axis=1)]))
        return float(np.mean(costs))

    return (one_way(first, second) + one_way(second, first)) / 2


@settings(max_examples=6)
@given(st.integers(0, 10_000))
def test_the_distance_is_the_papers_words(seed):
    first, second = blocks(seed), blocks(seed + 1)
    assert image_distance(first, second) == pytest.approx(slow_distance(first, second))
    assert image_distance(first, second) == image_distance(second, first)
    assert image_distance(first, first) == 0.0


def test_images_that_are_none_are_refused(database: PoseDatabase):
    for wrong in (np.zeros((39, 40), np.uint8), np.zeros((40, 40)), np.full((40, 40), 11, np.uint8)):
        with pytest.raises(BadInput, match="a tiny image is"):
            distance_transform(wrong)
    lookup = PoseLookup(database, None)
    with pytest.raises(BadInput, match="without any glove pixel"):
        lookup.neighbours(np.zeros((40, 40), np.uint8))
    with pytest.raises(BadInput, match="0 neighbours"):
        lookup.neighbours(database.tiny[0], 0)


@settings(max_examples=30)
@given(st.integers(0, 10_000))
def test_a_window_follows_the_glove_wherever_it_is_and_however_large(seed):
    rng = np.random.default_rng(seed)
    labels = np.zeros((120, 160), np.uint8)
    v, u, size = int(rng.integers(20, 70)), int(rng.integers(20, 100)), int(rng.integers(8, 30))
    labels[v : v + size, u : u + size] = 3
    window = glove_window(labels)
    assert window is not None
    assert (window.u, window.v) == pytest.approx((u + (size - 1) / 2, v + (size - 1) / 2))
    tiny = tiny_image(labels, window)
    share = (2 * window.half / size) ** 2
    assert (tiny == 3).mean() == pytest.approx(1 / share, rel=0.25)
    corners = np.array([[window.u - window.half, window.v], [window.u + window.half, window.v]])
    assert np.allclose(window.to_tiny(corners)[:, 0], [-0.5, len(tiny) - 0.5])


def test_no_glove_no_window_and_stray_pixels_do_not_move_it():
    labels = np.zeros((240, 320), np.uint8)
    assert glove_window(labels) is None
    labels[100:160, 150:190] = 4
    alone = glove_window(labels)
    labels[np.random.default_rng(1).random(labels.shape) < 0.0005] = 2
    stray = glove_window(labels)
    assert alone is not None
    assert stray is not None
    assert abs(stray.u - alone.u) + abs(stray.v - alone.v) < 4
    assert tiny_image(labels, Window(-500.0, -500.0, 20.0)).max() == 0


@pytest.fixture(scope="module")
def boosted(database: PoseDatabase) -> BoostedCode:
    return boosted_code(database.tiny, database.transforms, 64, 1000)


@pytest.fixture(scope="module")
def queries() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Tiny images, angles and rotations of hands that the database does not hold."""
    angles, turns = generated_poses(80, seed=9), orientations(80, 75.0, np.random.default_rng(9))
    return rendered_views(SKIN, PATTERN, angles, turns)["tiny"], angles, turns


def test_the_nearest_of_an_entry_is_itself(database: PoseDatabase, boosted: BoostedCode):
    for code in (pca_code(database.transforms), boosted, None):
        lookup = PoseLookup(database, code)
        for entry in (3, 800):
            found = lookup.neighbours(database.tiny[entry])
            assert found.distances[0] == 0.0
            assert entry in found.entries[found.distances == 0.0]
            assert (np.diff(found.distances) >= 0).all()


def test_codes_foretell_the_nearest_image(database: PoseDatabase, boosted: BoostedCode, queries):
    brute = PoseLookup(database, None)
    codes = {"pca": pca_code(database.transforms), "boosted": boosted}
    ranks: dict[str, list[int]] = {name: [] for name in codes}
    for tiny in queries[0]:
        best = brute.neighbours(tiny, 1).entries[0]
        for name, code in codes.items():
            order = code.nearest(distance_transform(tiny), len(database))
            ranks[name].append(int(np.flatnonzero(order == best)[0]) + 1)
    assert np.mean(ranks["pca"]) < 6
    assert np.mean(ranks["boosted"]) < 25


def test_bits_differ_as_counted_one_by_one(database: PoseDatabase, boosted: BoostedCode):
    bits = np.array(database.transforms).reshape(len(database), -1)[:, boosted.features] > boosted.thresholds
    for count in (5, 40, 64):
        code = boosted.shortened(count)
        expected = (bits[:, :count] != bits[7, :count]).sum(axis=1)
        assert np.array_equal(code.hamming(database.transforms[7]), expected)
    with pytest.raises(BadInput, match="65 bits"):
        boosted.shortened(65)


def test_learning_codes_can_be_cancelled(database: PoseDatabase):
    with pytest.raises(Cancelled):
        boosted_code(database.tiny, database.transforms, 8, 100, cancelled=lambda: True)
    with pytest.raises(BadInput, match="dimensions"):
        pca_code(database.transforms[:5], 6)


def test_a_blend_is_nearer_than_the_nearest_alone(database: PoseDatabase, queries):
    lookup = PoseLookup(database, pca_code(database.transforms))
    alone, blended = [], []
    for tiny, angles, _ in zip(*queries, strict=True):
        found = lookup.neighbours(tiny)
        assert found.weights.sum() == pytest.approx(1.0)
        alone.append(np.abs(database.angles_deg[found.entries[0]] - angles).mean())
        blended.append(np.abs(lookup.blend(found)[0] - angles).mean())
    assert np.mean(blended) < 0.95 * np.mean(alone)


@pytest.mark.parametrize("place", [(0.0, 0.0, 500.0), (90.0, -40.0, 700.0), (-110.0, 60.0, 420.0)])
def test_an_entry_anywhere_before_a_camera_is_placed_there(database: PoseDatabase, place):
    """The hand is turned with its direction, so that it shows the camera what it showed the virtual one."""
    camera, lookup, entry = Camera(), PoseLookup(database, None), 42
    ray = np.array(place)
    axis = ray / np.linalg.norm(ray)
    across = np.cross([0.0, 0.0, 1.0], axis)
    k = np.array([[0, -across[2], across[1]], [across[2], 0, -across[0]], [-across[1], across[0], 0]])
    turn = np.eye(3) + k + k @ k / (1 + axis[2])
    own = database.state(entry)
    rotation = turn @ own.rotation
    state = HandState(own.angles_deg, rotation, ray - rotation @ database.palm_centre_mm)
    labels = rasterise(posed(SKIN, state), SKIN.triangles, camera).painted(PATTERN.colour)
    window = glove_window(labels)
    assert window is not None
    one = Neighbours(np.array([entry]), np.zeros(1))
    found = lookup.placed(one, window, camera)
    centre = found.rotation @ database.palm_centre_mm + found.position_mm
    assert np.allclose(centre[:2], place[:2], atol=8.0)
    assert centre[2] == pytest.approx(place[2], rel=0.05)
    between = np.trace(found.rotation.T @ state.rotation)
    assert np.degrees(np.arccos(np.clip((between - 1) / 2, -1, 1))) < 2.0


def test_a_sleeve_of_a_glove_colour_is_left_out_and_no_part_of_the_glove(database: PoseDatabase):
    lookup = PoseLookup(database, pca_code(database.transforms))
    rng = np.random.default_rng(3)
    taken = 0
    for entry in rng.choice(len(database), 12, replace=False):
        labels = np.kron(np.array(database.tiny[entry]), np.ones((4, 4), np.uint8))
        labels = np.pad(labels, ((40, 120), (40, 40)))
        alone = Sighting.of(labels, lookup)
        assert alone is not None
        assert np.array_equal(alone.labels, labels)
        lowest = np.nonzero(labels.any(axis=1))[0].max()
        columns = np.nonzero(labels[lowest])[0]
        sleeve = labels.copy()
        sleeve[lowest + 1 :, columns.min() : columns.min() + 50] = labels[lowest, columns[0]]
        seen = Sighting.of(sleeve, lookup)
        assert seen is not None
        if not seen.labels[lowest + 2 :].any():
            taken += 1
            assert abs(seen.window.half - alone.window.half) < 0.15 * alone.window.half
    assert taken >= 11
    assert Sighting.of(np.zeros((60, 60), np.uint8), lookup) is None
