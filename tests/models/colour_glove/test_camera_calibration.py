"""Cameras calibrated from drawn pictures of the board, against the cameras that drew them; camera files."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from board_pictures import BoardRoom, board_poses
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from glovecal_models.colour_glove.camera_calibration import (
    CameraCalibration,
    ViewCollector,
    board_view,
    board_views,
    calibrate_camera,
    place_camera,
)
from glovecal_models.colour_glove.camera_model import (
    Camera,
    camera_document,
    camera_from_document,
    read_cameras,
    write_cameras,
)
from glovecal_models.colour_glove.sheets.calibration_board import CalibrationBoard
from glovecal_models.errors import BadInput

BOARD = CalibrationBoard()
TRUE = Camera(
    focal_px=(533.0, 531.0), centre_px=(325.0, 236.0), distortion=(-0.21, 0.08, 0.001, -0.0007, 0.01)
)
TURN = Rotation.from_euler("y", 50, degrees=True).as_matrix()
MIDDLE_MM = np.array([0.0, 0.0, 450.0])
BESIDE = replace(
    TRUE,
    focal_px=(610.0, 612.0),
    centre_px=(315.0, 243.0),
    rotation=tuple(tuple(row) for row in TURN),
    translation_mm=tuple(MIDDLE_MM - TURN @ MIDDLE_MM),
)


@pytest.fixture(scope="module")
def room() -> BoardRoom:
    return BoardRoom(TRUE)


@pytest.fixture(scope="module")
def views(room: BoardRoom) -> list:
    rng = np.random.default_rng(3)
    pictures = [(f"{k}.png", room.picture(*pose, rng)) for k, pose in enumerate(board_poses(BOARD, 12, rng))]
    found, refused = board_views(pictures, BOARD)
    assert refused == []
    return found


def test_the_camera_that_drew_the_board_is_found(views: list) -> None:
    found = calibrate_camera(views, BOARD)
    assert found.rms_px < 0.2
    assert found.camera.focal_px == pytest.approx(TRUE.focal_px, rel=0.005)
    assert found.camera.centre_px == pytest.approx(TRUE.centre_px, abs=3.0)
    for value, truth, deviation in zip(
        (*found.camera.focal_px, *found.camera.centre_px),
        (*TRUE.focal_px, *TRUE.centre_px),
        (*found.focal_sd_px, *found.centre_sd_px),
        strict=True,
    ):
        assert abs(value - truth) < 4 * deviation
    # The lens, where corners were seen: the same rays within a pixel.
    pixels = np.concatenate([view.corners_px for view in views])
    rays = np.column_stack([TRUE.undistort(pixels), np.ones(len(pixels))])
    off = found.camera.project(rays) - pixels
    assert np.std(off, axis=0).max() < 0.3
    assert 0.3 < found.covered < 1
    assert len(found.view_rms_px) == len(views)


def test_a_board_of_another_size_gives_the_same_lens(views: list) -> None:
    larger = CalibrationBoard(2 * BOARD.square_mm)
    assert calibrate_camera(views, larger).camera.focal_px == pytest.approx(
        calibrate_camera(views, BOARD).camera.focal_px, rel=1e-4
    )


def test_another_camera_is_placed(room: BoardRoom) -> None:
    beside, rng = BoardRoom(BESIDE), np.random.default_rng(5)
    between = Rotation.from_euler("y", -25, degrees=True).as_matrix()
    seen = []
    for number, (rotation, place) in enumerate(board_poses(BOARD, 7, rng, tilt_deg=15, aside=0.1)):
        turned = between @ rotation
        middle = between @ (place + rotation @ [*BOARD.size_mm, 0.0] / np.array(2.0) - MIDDLE_MM) + MIDDLE_MM
        corner = middle - turned @ np.array([*BOARD.size_mm, 0.0]) / 2
        seen.append(
            [board_view(each.picture(turned, corner, rng), BOARD, f"{number}") for each in (room, beside)]
        )
    mine, theirs = (list(each) for each in zip(*seen, strict=True))
    plain = replace(BESIDE, rotation=Camera().rotation, translation_mm=(0.0, 0.0, 0.0))
    known = [
        CameraCalibration(camera, 0.1, (0.5, 0.5), (0.7, 0.7), (0.0,) * 5, (), 1.0)
        for camera in (TRUE, plain)
    ]
    found = place_camera(known[0], mine, known[1], theirs, BOARD)
    turn = Rotation.from_matrix(np.array(found.camera.rotation) @ TURN.T).magnitude()
    assert found.rms_px < 0.3
    assert np.degrees(turn) < 0.1
    assert found.camera.translation_mm == pytest.approx(BESIDE.translation_mm, abs=1.0)
    # A centre known to 0.7 pixels of 533 alone turns each camera by 0.075 degrees, at 450 mm by 0.6 mm.
    assert 0.05 < found.turn_sd_deg < 0.3
    assert 0.4 < found.place_sd_mm < 2.5
    sure = [replace(each, focal_sd_px=(0.0, 0.0), centre_sd_px=(0.0, 0.0)) for each in known]
    assert place_camera(sure[0], mine, sure[1], theirs, BOARD).turn_sd_deg < 0.5 * found.turn_sd_deg
    with pytest.raises(BadInput, match="in 3 pictures of the same name; at least 5"):
        place_camera(known[0], mine[:3], known[1], theirs, BOARD)


def test_pictures_that_do_not_serve_are_named(room: BoardRoom) -> None:
    rng = np.random.default_rng(1)
    (pose,) = board_poses(BOARD, 1, rng, tilt_deg=10, aside=0.05)
    far = (pose[0], pose[1] + (430.0, 0.0, 0.0))
    pictures = [
        ("good.png", room.picture(*pose, rng)),
        ("moved.png", room.picture(*pose, rng, motion_px=6)),
        ("focus.png", room.picture(*pose, rng, blur_px=3.0)),
        ("half.png", room.picture(*far, rng)),
        ("wall.png", np.full((480, 640, 3), 90, np.uint8)),
    ]
    found, refused = board_views(pictures, BOARD)
    assert [view.name for view in found] == ["good.png"]
    said = dict(zip(("moved.png", "focus.png", "half.png", "wall.png"), refused, strict=True))
    assert all(sentence.startswith(name) for name, sentence in said.items())
    assert "Hold the board still" in said["moved.png"]
    assert "focus" in said["focus.png"]
    assert "Show more of it" in said["half.png"] or "no board" in said["half.png"]
    assert "no board is seen" in said["wall.png"]


def test_views_that_do_not_fix_a_camera_are_refused(room: BoardRoom, views: list) -> None:
    with pytest.raises(BadInput, match="7 good views of the board; at least 8"):
        calibrate_camera(views[:7], BOARD)
    with pytest.raises(BadInput, match="320 x 240"):
        calibrate_camera([*views, replace(views[0], size=(320, 240))], BOARD)
    rng = np.random.default_rng(2)
    for tilt_deg in (0.0, 5.0):
        flat = board_poses(BOARD, 8, rng, tilt_deg=tilt_deg, distance_mm=(480, 500), aside=0.05)
        level = [board_view(room.picture(*pose, rng), BOARD, str(k)) for k, pose in enumerate(flat)]
        with pytest.raises(BadInput, match=r"in 0 of 8 views.*Tilt the board"):
            calibrate_camera(level, BOARD)
    shaken = [
        replace(view, corners_px=view.corners_px + rng.normal(0, 4, view.corners_px.shape)) for view in views
    ]
    with pytest.raises(BadInput, match=r"RMS|Tilt"):
        calibrate_camera(shaken, BOARD)


def test_a_collector_takes_still_boards_in_new_places(room: BoardRoom) -> None:
    rng = np.random.default_rng(4)
    first, second = (room.picture(*pose, rng) for pose in board_poses(BOARD, 2, rng))
    collector = ViewCollector(BOARD)
    said = [str(collector.offer([picture], "now")) for picture in (first, first, first, second, second)]
    assert ["still" in said[0], said[1], "move or tilt" in said[2], "still" in said[3], said[4]] == [
        True, "None", True, True, "None",
    ]  # fmt: skip
    assert [len(views) for views in collector.views] == [2]


def test_cameras_come_back_from_a_file_as_they_were(tmp_path: Path) -> None:
    write_cameras(tmp_path / "camera.json", [TRUE, BESIDE])
    assert read_cameras(tmp_path / "camera.json") == (TRUE, BESIDE)
    assert [file.name for file in tmp_path.iterdir()] == ["camera.json"]
    with pytest.raises(BadInput, match="0 cameras"):
        write_cameras(tmp_path / "none.json", [])
    with pytest.raises(BadInput, match="17 cameras"):
        write_cameras(tmp_path / "many.json", [TRUE] * 17)


GOOD = camera_document(TRUE)
NUMBERS = st.one_of(st.floats(), st.integers(), st.booleans(), st.none(), st.text(max_size=3))


@settings(max_examples=80)
@given(
    st.sampled_from([*GOOD, "lens"]),
    st.one_of(NUMBERS, st.lists(NUMBERS, max_size=6), st.lists(st.lists(NUMBERS, max_size=4), max_size=4)),
)
def test_a_camera_is_read_whole_or_refused(key: str, value: object) -> None:
    document = {**GOOD, key: value}
    try:
        found = camera_from_document(document)
    except BadInput:
        return
    assert key != "lens"
    assert camera_document(found) == json.loads(json.dumps(document))


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("{", "no JSON"),
        ("[]", 'expected "format" and "cameras"'),
        ('{"format": "glovecal cameras 2", "cameras": []}', "glovecal cameras 2"),
        ('{"format": "glovecal cameras 1", "cameras": [{}]}', "camera 1: a camera has the keys"),
        ('{"format": "glovecal cameras 1", "cameras": [], "more": 1}', "nothing else"),
        (" " * 100_001, "100001 bytes"),
        ("[" * 50_000, "no JSON"),
    ],
)
def test_other_files_are_refused(tmp_path: Path, text: str, why: str) -> None:
    file = tmp_path / "camera.json"
    file.write_text(text)
    with pytest.raises(BadInput, match=why) as refused:
        read_cameras(file)
    assert str(file) in str(refused.value)
