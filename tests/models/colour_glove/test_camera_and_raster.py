"""Projection against OpenCV and its own inverse; the z-buffer against rays and OpenCV's polygons."""

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from glovecal_models.colour_glove.camera_model import Camera
from glovecal_models.colour_glove.hand_state import HandState
from glovecal_models.colour_glove.pattern import glove_pattern
from glovecal_models.colour_glove.rasterise import rasterise
from glovecal_models.colour_glove.skin import hand_skin, posed
from glovecal_models.errors import BadInput

LENS = (-0.21, 0.07, 0.0012, -0.0008, -0.01)


def tilted(**more) -> Camera:
    turn = Rotation.from_rotvec([0.2, -0.4, 0.1]).as_matrix()
    return Camera(
        rotation=tuple(map(tuple, turn)), translation_mm=(30.0, -10.0, 50.0), distortion=LENS, **more
    )


def matrix(camera: Camera) -> np.ndarray:
    (fx, fy), (cx, cy) = camera.focal_px, camera.centre_px
    return np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1.0]])


def test_it_projects_as_opencv_does():
    camera = tilted(focal_px=(533.0, 541.0))
    points = np.random.default_rng(1).uniform([-150, -120, 350], [150, 120, 800], (200, 3))
    turn = cv2.Rodrigues(np.array(camera.rotation))[0]
    found, _ = cv2.projectPoints(
        points, turn, np.array(camera.translation_mm), matrix(camera), np.array(LENS)
    )
    assert np.allclose(camera.project(points), found[:, 0], atol=1e-8)


@settings(max_examples=30)
@given(st.integers(0, 10_000))
def test_undistorting_is_the_inverse(seed):
    camera = Camera(distortion=LENS)
    points = np.random.default_rng(seed).uniform([-200, -150, 400], [200, 150, 900], (50, 3))
    rays = camera.undistort(camera.project(points))
    assert np.allclose(rays, points[:, :2] / points[:, 2:], atol=1e-8)


def test_what_is_behind_the_camera_has_no_pixel():
    assert np.isnan(Camera().project(np.array([[0.0, 0.0, -5.0], [0.0, 0.0, 0.0]]))).all()


@pytest.mark.parametrize(
    "wrong",
    [{"width": 0}, {"focal_px": (0.0, 1.0)}, {"rotation": ((1.0, 0.0),)}, {"centre_px": (np.nan, 0.0)}],
)
def test_no_camera_is_refused(wrong):
    with pytest.raises(BadInput):
        Camera(**wrong)


def by_rays(vertices: np.ndarray, triangles: np.ndarray, camera: Camera) -> np.ndarray:
    """Depth by meeting each pixel's ray with each triangle's plane (Moeller & Trumbore)."""
    depth = np.full((camera.height, camera.width), np.inf)
    (fx, fy), (cx, cy) = camera.focal_px, camera.centre_px
    for v in range(camera.height):
        for u in range(camera.width):
            ray = np.array([(u - cx) / fx, (v - cy) / fy, 1.0])
            for a, b, c in vertices[triangles]:
                determinant = np.dot(b - a, np.cross(ray, c - a))
                if abs(determinant) < 1e-12:
                    continue
                s = np.dot(-a, np.cross(ray, c - a)) / determinant
                t = np.dot(ray, np.cross(-a, b - a)) / determinant
                z = np.dot(c - a, np.cross(-a, b - a)) / determinant
                if s >= 0 and t >= 0 and s + t <= 1 and z > 0:
                    depth[v, u] = min(depth[v, u], z)
    return depth


@settings(max_examples=8)
@given(st.integers(0, 10_000))
def test_depths_are_those_of_rays_also_where_triangles_meet(seed):
    rng = np.random.default_rng(seed)
    camera = Camera(16, 12, (14.0, 15.0), (7.5, 5.5))
    vertices = rng.uniform([-40, -30, 40], [40, 30, 120], (12, 3))
    triangles = rng.permutation(12).reshape(4, 3)
    found = rasterise(vertices, triangles, camera)
    expected = by_rays(vertices, triangles, camera)
    assert np.array_equal(np.isinf(found.depth_mm), np.isinf(expected))
    seen = np.isfinite(expected)
    assert np.allclose(found.depth_mm[seen], expected[seen], rtol=1e-5)


def test_two_crossing_plates_are_in_front_by_turns():
    plates = np.array([[-50, -50, 80], [50, -50, 120], [50, 50, 120], [-50, 50, 80]], dtype=float)
    vertices = np.vstack([plates, plates * (-1, 1, 1)])
    triangles = np.array([[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]])
    found = rasterise(vertices, triangles, Camera(41, 31, (40.0, 40.0), (20.0, 15.0)))
    plate = found.painted(np.array([1, 1, 2, 2]))
    assert set(plate[5:26, 8:19].ravel()) == {1}
    assert set(plate[5:26, 22:33].ravel()) == {2}


def seen_hand() -> tuple[np.ndarray, np.ndarray]:
    back = np.array([[0, -1, 0], [-1, 0, 0], [0, 0, -1.0]])
    angles = np.linspace(5, 30, 20)
    return posed(hand_skin(), HandState(angles, back, np.array([0.0, 90.0, 420.0]))), hand_skin().triangles


def test_the_hand_covers_what_opencvs_polygons_cover():
    vertices, triangles = seen_hand()
    camera = Camera()
    found = rasterise(vertices, triangles, camera)
    canvas, pixels = np.zeros((480, 640), np.uint8), camera.project(vertices)
    for triangle in triangles:
        cv2.fillConvexPoly(canvas, np.round(pixels[triangle] * 256).astype(np.int32), 255, shift=8)
    ours = found.triangle >= 0
    assert ours.sum() > 10_000
    edge = cv2.dilate(canvas, np.ones((3, 3))) != cv2.erode(canvas, np.ones((3, 3)))
    assert not ((canvas > 0) != ours)[~edge].any()


def test_the_same_picture_twice_and_with_a_scaled_camera():
    vertices, triangles = seen_hand()
    camera = Camera(64, 48, (53.3, 53.3), (31.5, 23.5))
    once, twice = rasterise(vertices, triangles, camera), rasterise(vertices, triangles, camera)
    assert np.array_equal(once.triangle, twice.triangle)
    assert np.array_equal(once.depth_mm, twice.depth_mm)
    fine = rasterise(vertices, triangles, camera.scaled(5))
    assert np.array_equal(fine.triangle[2::5, 2::5], once.triangle)
    colours = glove_pattern(hand_skin()).colour
    labels = once.painted(colours)
    assert labels.dtype == np.uint8
    assert (labels == 0).sum() == (once.triangle < 0).sum()


def test_a_mesh_that_is_none_is_refused():
    with pytest.raises(BadInput, match="a mesh has"):
        rasterise(np.zeros((3, 2)), np.zeros((1, 3), int), Camera())
    with pytest.raises(BadInput, match="name vertices"):
        rasterise(np.zeros((3, 3)), np.array([[0, 1, 3]]), Camera())
