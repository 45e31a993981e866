"""The colour glove's sheets and a camera's calibration through the command line."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pypdfium2
import pytest
from board_pictures import BoardRoom, board_poses
from cli_running import Run
from phone_videos import phone_video

from glovecal_client.pictures.source import Picture
from glovecal_client.pictures.video_file import VideoWriter
from glovecal_models.colour_glove.camera_model import Camera, read_cameras
from glovecal_models.colour_glove.pattern import PRINTED_SRGB
from glovecal_models.colour_glove.pictures.classify import ColourTable
from glovecal_models.colour_glove.sheets.calibration_board import CalibrationBoard

SMALL = Camera(400, 300, (333.0, 333.0), (199.5, 149.5))
WITHOUT = """
import sys
class Missing:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] == "numba":
            raise ModuleNotFoundError("No module named 'numba'", name="numba")
sys.meta_path.insert(0, Missing())
from glovecal_service.cli.command import main
main(["camera", "sheets", "--out", sys.argv[1]])
"""


def test_sheets_are_written_for_a_subject(run: Run, tmp_path: Path) -> None:
    assert run("subject", "add", "pia", "--hand", "left", "--hand-length-mm", 172).code == 0
    written = run("camera", "sheets", "--subject", "pia", "--out", tmp_path / "print", "--json")
    assert written.code == 0, written.err
    assert (written.json["hand"], written.json["hand_length_mm"]) == ("left", 172)
    for files in written.json["files"].values():
        document = pypdfium2.PdfDocument(files[0])
        sizes = [sorted(round(side / 72 * 25.4, 1) for side in page.get_size()) for page in document]
        document.close()
        assert sizes == [[210.0, 297.0]] * (len(files) - 1)
        assert all(Path(svg).stat().st_size > 1000 for svg in files[1:])


def test_what_cannot_be_printed_is_said(run: Run, tmp_path: Path) -> None:
    small = run("camera", "sheets", "--out", tmp_path, "--hand-length-mm", 17)
    assert (small.code, "between 60 and 300 mm" in small.said) == (1, True)
    (tmp_path / "own.json").write_text(json.dumps({"colours": [1, 2]}))
    pattern = run("camera", "sheets", "--out", tmp_path, "--pattern", tmp_path / "own.json")
    assert (pattern.code, "20 numbers of 1 to 10" in pattern.said) == (1, True)
    assert list(tmp_path.glob("*.pdf")) == []


def test_without_the_extra_it_says_how_to_install_it(tmp_path: Path) -> None:
    found = subprocess.run(
        [sys.executable, "-c", WITHOUT, str(tmp_path)], capture_output=True, text=True, timeout=60
    )
    assert found.returncode == 1
    assert re.search(r"the colour glove needs .*numba.* not installed: .* install .*numba", found.stderr)


def drawn(folder: Path, room: BoardRoom, poses: list[tuple[np.ndarray, np.ndarray]], seed: int) -> Path:
    folder.mkdir()
    rng = np.random.default_rng(seed)
    for number, pose in enumerate(poses):
        cv2.imwrite(str(folder / f"{number:02}.png"), room.picture(*pose, rng))
    return folder


def test_two_cameras_are_calibrated_from_folders_and_pictures_that_do_not_serve_are_named(
    run: Run, tmp_path: Path
) -> None:
    board, true = CalibrationBoard(), replace(SMALL, distortion=(-0.1, 0.05, 0.0, 0.0, 0.0))
    beside = replace(true, translation_mm=(-80.0, 0.0, 0.0))
    poses = board_poses(board, 10, np.random.default_rng(1), aside=0.15)
    left = drawn(tmp_path / "left", BoardRoom(true), poses, 1)
    right = drawn(tmp_path / "right", BoardRoom(beside), poses, 2)
    cv2.imwrite(str(left / "wall.png"), np.full((300, 400, 3), 90, np.uint8))
    (left / "broken.png").write_bytes(b"no picture")
    file = tmp_path / "camera.json"
    done = run("camera", "calibrate", "--pictures", left, "--second", right, "--out", file, "--json")
    assert done.code == 0, done.err
    assert [sentence.split()[0].strip(":") for sentence in done.json["refused"]] == ["broken.png", "wall.png"]
    first, second = read_cameras(file)
    assert first.focal_px == pytest.approx(true.focal_px, rel=0.01)
    assert first.translation_mm == (0.0, 0.0, 0.0)
    assert second.translation_mm == pytest.approx(beside.translation_mm, abs=6.0)
    assert done.json["cameras"][1]["placement"]["views"] == 10

    again = run("camera", "calibrate", "--pictures", left, "--out", file, "--square-mm", 34)
    assert "focal length (px)" in again.out
    assert "Not used: wall.png: no board is seen" in again.err
    for number in range(5):
        (left / f"{number:02}.png").unlink()
    few = run("camera", "calibrate", "--pictures", left, "--out", tmp_path / "few.json")
    assert (few.code, "5 good views of the board; at least 8" in few.said) == (1, True)
    assert not (tmp_path / "few.json").exists()
    both = run("camera", "calibrate", "--pictures", left, "--camera", "camera:0", "--out", file)
    assert (both.code, "either --pictures FOLDER or --camera" in both.said) == (2, True)


def test_a_camera_is_calibrated_from_a_video(run: Run, tmp_path: Path) -> None:
    board, rng = CalibrationBoard(), np.random.default_rng(1)
    room = BoardRoom(SMALL)
    video = VideoWriter(tmp_path / "board.mkv", 30.0)
    for pose in board_poses(board, 9, rng):
        for _ in range(2):  # held still
            video.write(Picture.now(room.picture(*pose, rng)))
    video.close()
    file = tmp_path / "camera.json"
    done = run("camera", "calibrate", "--camera", f"video:{tmp_path / 'board.mkv'}", "--out", file)
    assert done.code == 0, done.err
    assert "9 of 20 views: taken" in done.err
    (found,) = read_cameras(file)
    assert found.focal_px == pytest.approx(SMALL.focal_px, rel=0.01)


def test_a_colour_table_is_learned_on_labelled_pictures(run: Run, tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    labels = np.repeat(np.repeat(np.arange(12, dtype=np.uint8).reshape(3, 4) % 11, 40, 0), 40, 1)
    colours = np.vstack([[90, 90, 90], PRINTED_SRGB[:, ::-1]])[labels]
    picture = np.clip(colours + rng.normal(0, 4, colours.shape), 0, 255).astype(np.uint8)
    for name, image in (("hand.png", picture), ("hand.labels.png", labels)):
        cv2.imwrite(str(tmp_path / name), image)
    hand, file = tmp_path / "hand.png", tmp_path / "table.npz"
    done = run("camera", "colours", hand, "--labelled", "--out", file)
    assert done.code == 0, done.err
    assert "Learned on 1 labelled pictures" in done.out
    assert (ColourTable.load(file).labels(picture) == labels).mean() > 0.95
    kept = run("camera", "store", "desk", "--colours", file, "--json")
    assert kept.json == {"colours": ["desk"], "calibrations": []}
    wrong = run("camera", "store", "desk", "--calibration", file)
    assert (wrong.code, "is no JSON" in wrong.said) == (1, True), wrong.said
    cv2.imwrite(str(tmp_path / "hand.labels.png"), np.minimum(labels, 9))
    few = run("camera", "colours", hand, "--labelled", "--out", tmp_path / "no.npz")
    assert (few.code, "colour 10 is in none of the 1 label images" in few.said) == (1, True)
    card = run("camera", "colours", hand, "--out", tmp_path / "no.npz")
    assert (card.code, "page is not found" in card.said or "does not look like" in card.said) == (1, True)
    assert not (tmp_path / "no.npz").exists()


def test_a_phones_video_is_imported_with_its_own_times(run: Run, tmp_path: Path) -> None:
    pictures = [np.full((48, 64, 3), 90, np.uint8)] * 8
    phone_video(tmp_path / "IMG_0042.MOV.mov", pictures, [30 + 20 * (number % 2) for number in range(8)])
    phone = (tmp_path / "IMG_0042.MOV.mov").rename(tmp_path / "IMG_0042.MOV")
    imported = run("camera", "import", phone)
    assert imported.code == 0, imported.err
    assert "img_0042: 8 pictures in 0.3 s; the file's own times, a variable rate, 20.0 to 33.3 Hz." in (
        imported.out
    )
    again = run("camera", "import", phone, "--name", "fist", "--json")
    assert (again.json["name"], again.json["pictures"]) == ("fist", 8)
    (tmp_path / "no.mp4").write_text("no video")
    refused = run("camera", "import", tmp_path / "no.mp4")
    assert (refused.code, "cannot be read as a video" in refused.said) == (1, True)
