"""``glovecal camera calibrate`` and ``colours``: what is measured from pictures before a hand is tracked.

A camera's lens and a second one's place, from pictures of the board; the table by which the glove's colours
are told.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
import typer

from glovecal_service.cli.camera.sheets import Paper
from glovecal_service.cli.camera.tracking_options import camera_extra
from glovecal_service.cli.terminal.options import AsJson
from glovecal_service.cli.terminal.printing import Refusal, err, out, print_facts, print_json

if TYPE_CHECKING:
    from glovecal_models.colour_glove.camera_calibration import BoardView, CameraCalibration, CameraPlacement
    from glovecal_models.colour_glove.sheets.calibration_board import CalibrationBoard


SUFFIXES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff")
MOST_PICTURES = 500
_TELL_S = 1.5
"""Between two hints to the person with the board."""


def calibrate(
    file: Annotated[Path, typer.Option("--out", help="JSON file to write.", dir_okay=False)],
    pictures: Annotated[
        Path | None,
        typer.Option(help="Folder of pictures of the board, at least 8, better 20.", exists=True),
    ] = None,
    camera: Annotated[
        str | None, typer.Option(help="Or watch a camera: camera:NUMBER (0 is the first), video:FILE.mkv.")
    ] = None,
    second: Annotated[
        str | None,
        typer.Option(
            help="A second camera: a folder with pictures of the same names, taken at the same moments; or "
            "camera:NUMBER, video:FILE.mkv."
        ),
    ] = None,
    square_mm: Annotated[
        float, typer.Option(help="Side of a square of the printed board, as measured.")
    ] = 34.0,
    views: Annotated[int, typer.Option(min=8, max=100, help="Views to take from a camera.")] = 20,
    seconds: Annotated[float, typer.Option(min=1, help="Longest time to watch a camera.")] = 180.0,
    as_json: AsJson = False,
) -> None:
    """Calibrate one camera or two with the printed board (glovecal camera sheets)."""
    with camera_extra():
        from glovecal_models.colour_glove.camera_calibration import (
            board_views,
            calibrate_camera,
            place_camera,
        )
        from glovecal_models.colour_glove.camera_model import write_cameras
        from glovecal_models.colour_glove.sheets.calibration_board import CalibrationBoard

    if (pictures is None) == (camera is None):
        raise typer.BadParameter("give either --pictures FOLDER or --camera camera:NUMBER")
    board = CalibrationBoard(square_mm)
    if pictures is not None:
        folders = [pictures] if second is None else [pictures, Path(second)]
        found = [board_views(_pictures(folder), board) for folder in folders]
        seen, refused = [each for each, _ in found], [text for _, texts in found for text in texts]
    else:
        sources = [str(camera)] if second is None else [str(camera), second]
        seen, refused = _watched(sources, board, views, seconds), []
    for sentence in refused:
        err.print(f"Not used: {sentence}.")
    alone = [calibrate_camera(each, board) for each in seen]
    placed = [
        place_camera(alone[0], seen[0], other, its, board)
        for other, its in zip(alone[1:], seen[1:], strict=True)
    ]
    write_cameras(file, [alone[0].camera, *(each.camera for each in placed)])
    if as_json:
        print_json({"file": str(file), "refused": refused, "cameras": _documents(alone, placed)})
        return
    for number, (each, where) in enumerate(zip(alone, [None, *placed], strict=True), 1):
        print_facts(_facts(number, each, where))
        if each.covered < 0.5:
            out.print(
                f"The board was seen in {each.covered:.0%} of the picture only: outside, the lens is not "
                "measured. Take more views near the edges and corners."
            )
    out.print(f"Wrote {file}.")


def _pictures(folder: Path) -> list[tuple[str, np.ndarray]]:
    """By name. Raises Refusal for no pictures and too many."""
    import cv2

    files = sorted(file for file in folder.iterdir() if file.suffix.lower() in SUFFIXES)
    if not 1 <= len(files) <= MOST_PICTURES:
        raise Refusal(
            f"{folder} has {len(files)} pictures ({', '.join(SUFFIXES)}); 1 to {MOST_PICTURES} are possible"
        )
    found = []
    for file in files:
        picture = cv2.imdecode(np.frombuffer(file.read_bytes(), np.uint8), cv2.IMREAD_COLOR)
        # What cannot be read is refused by name like other pictures that do not serve.
        found.append((file.name, np.empty((0, 0), np.uint8) if picture is None else picture))
    return found


def _watched(
    sources: Sequence[str], board: CalibrationBoard, wanted: int, seconds: float
) -> list[list[BoardView]]:
    """Views chosen from running cameras; ends when there are enough, at the end of a video, with the time."""
    from glovecal_client.errors import DeviceFinished
    from glovecal_client.pictures.source import build_source
    from glovecal_models.colour_glove.camera_calibration import ViewCollector

    opened = [build_source(source) for source in sources]
    collector = ViewCollector(board, len(opened))
    hint, end = _Hint(), time.monotonic() + seconds
    try:
        for source in opened:
            source.open()
        number = 0
        while len(collector.views[0]) < wanted and time.monotonic() < end:
            number += 1
            try:
                moment = [source.read().pixels for source in opened]
            except DeviceFinished:
                break
            said = collector.offer(moment, f"picture {number}")
            count = f"{len(collector.views[0])} of {wanted} views"
            hint.say(f"{count}: taken" if said is None else f"{count}: {said}", at_once=said is None)
    finally:
        for source in opened:
            source.close()
    return collector.views


class _Hint:
    """What to do next, not too often."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock, self._last = clock, -1e9

    def say(self, sentence: str, *, at_once: bool) -> None:
        if at_once or self._clock() - self._last > _TELL_S:
            self._last = self._clock()
            err.print(sentence)


def _facts(number: int, found: CameraCalibration, where: CameraPlacement | None) -> dict[str, str]:
    camera = found.camera
    worst, off = found.view_rms_px[0]
    (fx, fy), (cu, cv), (sx, sy), (su, sv) = (
        camera.focal_px, camera.centre_px, found.focal_sd_px, found.centre_sd_px,
    )  # fmt: skip
    facts = {
        f"camera {number}": f"{camera.width} x {camera.height} pixels, {len(found.view_rms_px)} views",
        "focal length (px)": f"{fx:.1f} ± {sx:.1f}, {fy:.1f} ± {sy:.1f} (standard deviation)",
        "centre (px)": f"{cu:.1f} ± {su:.1f}, {cv:.1f} ± {sv:.1f}",
        "distortion": ", ".join(f"{value:.4f}" for value in camera.distortion) + " (k1, k2, p1, p2, k3)",
        "error of corners": f"{found.rms_px:.2f} px RMS, worst view {worst} {off:.2f} px",
        "picture covered": f"{found.covered:.0%}",
    }
    if where is not None:
        distance = float(np.linalg.norm(where.camera.translation_mm))
        facts["distance to camera 1"] = f"{distance:.1f} mm ± {where.place_sd_mm:.1f} mm"
        facts["turned by"] = f"{_turn_deg(where):.2f}° ± {where.turn_sd_deg:.2f}°"
        facts["both cameras"] = f"{where.rms_px:.2f} px RMS over {where.views} views"
    return facts


def _turn_deg(where: CameraPlacement) -> float:
    cosine = (np.trace(np.array(where.camera.rotation)) - 1) / 2
    return float(np.degrees(np.arccos(np.clip(cosine, -1, 1))))


def _documents(
    alone: Sequence[CameraCalibration], placed: Sequence[CameraPlacement]
) -> list[dict[str, object]]:
    from glovecal_models.colour_glove.camera_model import camera_document

    found = []
    for each, where in zip(alone, [None, *placed], strict=True):
        document: dict[str, object] = {
            "camera": camera_document(each.camera if where is None else where.camera),
            "rms_px": each.rms_px,
            "focal_sd_px": list(each.focal_sd_px),
            "centre_sd_px": list(each.centre_sd_px),
            "distortion_sd": list(each.distortion_sd),
            "covered": each.covered,
            "views": [{"name": name, "rms_px": rms} for name, rms in each.view_rms_px],
        }
        if where is not None:
            document["placement"] = {
                "rms_px": where.rms_px,
                "turn_sd_deg": where.turn_sd_deg,
                "place_sd_mm": where.place_sd_mm,
                "views": where.views,
            }
        found.append(document)
    return found


SUFFIX = ".npz"


def colours(
    pictures: Annotated[
        list[Path],
        typer.Argument(
            help="Pictures of the printed colour card in the light of the recording; or with --labelled "
            "of the glove.",
            exists=True,
            dir_okay=False,
            show_default=False,
        ),
    ],
    file: Annotated[Path, typer.Option("--out", help="Colour table to write (.npz).", dir_okay=False)],
    paper: Annotated[Paper, typer.Option(help="What the card is printed on.")] = Paper.a4,
    corners: Annotated[
        str | None,
        typer.Option(
            help="Of the card's page in a single picture, pixels from the left and the top, with the clock: "
            '"120,80 500,90 510,640 110,630". Default: they are found.'
        ),
    ] = None,
    labelled: Annotated[
        bool,
        typer.Option(
            "--labelled",
            help="Beside each hand.jpg lies hand.labels.png, grey levels 0 (no glove) to 10 (its colours).",
        ),
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Make a colour table for glovecal camera track --colours: for a printer, a camera and its light.

    From the card: its ten colours and the light's are measured, drawn photographs of the glove take them on,
    and the table is learned on these. From labelled pictures it is learned on them alone.
    """
    with camera_extra():
        from glovecal_models.colour_glove.pattern import COLOUR_NAMES, encoded_light
        from glovecal_models.colour_glove.pictures.white_balance import card_colours
        from glovecal_service.camera.tracking_setup import drawn_table, labelled_table, picture_file

    if file.suffix != SUFFIX or not file.absolute().parent.is_dir():
        raise Refusal(f"{file} cannot be written: a colour table ends in {SUFFIX}, in a folder that exists")
    if labelled:
        labelled_table(pictures).save(file)
        if as_json:
            print_json({"file": str(file), "pictures": len(pictures)})
        else:
            out.print(f"Learned on {len(pictures)} labelled pictures. Wrote {file}.")
        return
    card = card_colours(
        [picture_file(each) for each in pictures], paper.value, None if corners is None else _corners(corners)
    )
    drawn_table(card=card).save(file)
    levels = encoded_light(card.inks).tolist()
    gains = {"red": card.gains.red, "green": card.gains.green, "blue": card.gains.blue}
    if as_json:
        print_json(
            {
                "file": str(file),
                "pictures": len(pictures),
                "corners_px": card.corners_px.tolist(),
                "gains": gains,
                "srgb": dict(zip(COLOUR_NAMES, levels, strict=True)),
            }
        )
        return
    for number, (name, level) in enumerate(zip(COLOUR_NAMES, levels, strict=True), 1):
        out.print(f"{number:2} {name}: sRGB {' '.join(map(str, level))} in white light")
    out.print(
        f"The light: red / green {1 / gains['red']:.2f}, blue / green {1 / gains['blue']:.2f} (1: white). "
        f"Learned on drawn photographs in these colours. Wrote {file}."
    )


def _corners(text: str) -> np.ndarray:
    try:
        found = np.array([[float(value) for value in pair.split(",")] for pair in text.split()])
    except ValueError:
        found = np.zeros(0)
    if found.shape != (4, 2) or not np.isfinite(found).all():
        raise typer.BadParameter(
            f'--corners {text!r}: expected four pairs, as in "120,80 500,90 510,640 110,630"'
        )
    return found
