"""Sheets are read back by programs that did not write them: PDFium, an XML parser, OpenCV's detector."""

import re
from functools import cache
from pathlib import Path
from xml.etree import ElementTree

import cv2
import numpy as np
import pypdfium2
import pytest

from glovecal_models.colour_glove.pattern import PRINTED_SRGB, glove_pattern, printed_pattern
from glovecal_models.colour_glove.sheets.calibration_board import (
    GREYS,
    CalibrationBoard,
    board_box,
    board_sheet,
    card_fields,
    colour_card,
)
from glovecal_models.colour_glove.sheets.flat_glove import FlatPiece, flat_pieces
from glovecal_models.colour_glove.sheets.glove_sheets import (
    SEAM_ALLOWANCE_MM,
    cut_line,
    glove_sheets,
    seam_marks,
)
from glovecal_models.colour_glove.sheets.sheet import MARGIN_MM, PAPERS_MM, SCALE_BAR_MM, Sheet, write_sheets
from glovecal_models.colour_glove.skin import HandSkin, hand_skin
from glovecal_models.errors import BadInput
from glovecal_models.hand.dimensions import HandDimensions
from glovecal_models.hand.skeleton import hand_skeleton

PIXELS_OF_POINT = 2
PIXELS_OF_MM = PIXELS_OF_POINT * 72 / 25.4
SMALL = {"hand_length": 172.0, "hand_breadth": 74.0}
HANDS = {
    "assumed": hand_skin(),
    "small left": hand_skin(hand_skeleton(HandDimensions.from_measured(SMALL), "left")),
}


def shown(file: Path) -> list[np.ndarray]:
    """Each page of a PDF as red, green, blue, (H, W, 3), ``PIXELS_OF_MM``."""
    document = pypdfium2.PdfDocument(file)
    pages = [page.render(scale=PIXELS_OF_POINT).to_numpy()[..., 2::-1].copy() for page in document]
    document.close()
    return pages


def sizes_mm(file: Path) -> list[tuple[float, float]]:
    document = pypdfium2.PdfDocument(file)
    found = [page.get_size() for page in document]
    document.close()
    return [(width / 72 * 25.4, height / 72 * 25.4) for width, height in found]


@cache
def pieces_of(skin: HandSkin) -> tuple[FlatPiece, FlatPiece]:
    return flat_pieces(skin, printed_pattern())


@pytest.mark.parametrize("skin", HANDS.values(), ids=HANDS)
def test_cloth_has_the_size_of_the_skin(skin: HandSkin) -> None:
    for piece in pieces_of(skin):
        assert abs(np.median(piece.stretch) - 1) < 0.01
        low, high = np.percentile(piece.stretch, [5, 95])
        assert low > 0.88
        assert high < 1.1
        flat, solid = (
            np.sum(areas(points, piece.triangles)) for points in (piece.points_mm, piece.surface_mm)
        )
        assert flat == pytest.approx(solid, rel=0.02)


def areas(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    a, b, c = (np.pad(points, ((0, 0), (0, 3 - points.shape[1])))[triangles[:, k]] for k in range(3))
    return np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2


def test_every_part_of_the_skin_up_to_the_opening_is_on_one_piece() -> None:
    skin = HANDS["assumed"]
    covered = sum(areas(piece.surface_mm, piece.triangles).sum() for piece in pieces_of(skin))
    beyond = areas(skin.vertices_mm, skin.triangles)
    middles = skin.vertices_mm[skin.triangles].mean(axis=1)
    assert covered == pytest.approx(beyond[middles[:, 0] > -0.07 * 190].sum(), rel=0.02)


@pytest.mark.parametrize("skin", HANDS.values(), ids=HANDS)
def test_seams_that_are_sewn_together_are_equally_long(skin: HandSkin) -> None:
    palm, back = pieces_of(skin)
    marks = seam_marks(palm, back)
    lengths = []
    for column, piece in enumerate((palm, back)):
        loop = np.vstack([piece.outline_mm, piece.outline_mm[:1]])
        along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(loop, axis=0), axis=1))])
        at = along[[pair[column] for pair in marks]]
        steps = np.diff(at if column == 0 else at[::-1])
        lengths.append(np.mod(steps, along[-1]) if column == 0 else np.mod(steps, along[-1])[::-1])
    difference = np.abs(lengths[0] - lengths[1])
    assert difference.max() < 0.12 * np.mean(lengths[0])
    assert lengths[0].sum() == pytest.approx(lengths[1].sum(), rel=0.03)


def test_a_piece_is_seen_from_outside() -> None:
    """The palm of a right hand with its fingers up has the thumb on the right, its back on the left."""
    for skin, side in ((HANDS["assumed"], 1.0), (HANDS["small left"], -1.0)):
        palm, back = pieces_of(skin)
        for piece, towards in ((palm, side), (back, -side)):
            thumb = piece.points_mm[
                np.isin(np.arange(len(piece.points_mm)), piece.triangles[piece.patch == 2])
            ]
            middle = piece.points_mm[piece.triangles[piece.patch == 1]].reshape(-1, 2)
            assert towards * (thumb[:, 0].mean() - middle[:, 0].mean()) > 60
            assert middle[:, 1].mean() < thumb[:, 1].mean()


def test_the_cut_runs_beside_the_seam() -> None:
    piece = pieces_of(HANDS["assumed"])[0]
    line = np.concatenate(cut_line(piece))
    away = np.linalg.norm(line[:, None] - piece.outline_mm[None], axis=2).min(axis=1)
    assert abs(away - SEAM_ALLOWANCE_MM).max() < 0.6


def test_one_pattern_is_printed_for_all_hands() -> None:
    assert np.array_equal(printed_pattern().patch, glove_pattern(HANDS["small left"]).patch) is False
    for skin in HANDS.values():
        on_sheets = set(np.concatenate([piece.patch for piece in pieces_of(skin)]))
        assert on_sheets == set(range(1, 21))


def test_the_glove_is_printed_at_full_size(tmp_path: Path) -> None:
    skin, paper = HANDS["assumed"], "letter"
    sheets = glove_sheets(skin, printed_pattern(), paper)
    written = write_sheets(tmp_path, "glove", sheets)
    pdf, svgs = written[0], written[1:]
    assert len(sizes_mm(pdf)) == len(svgs) == len(sheets)
    for size, svg in zip(sizes_mm(pdf), svgs, strict=True):
        assert sorted(size) == pytest.approx(PAPERS_MM[paper], abs=0.01)
        root = ElementTree.parse(svg).getroot()
        both = [re.fullmatch(r"([\d.]+)pt", root.attrib[name]) for name in ("width", "height")]
        assert [float(match[1]) / 72 * 25.4 for match in both if match] == pytest.approx(size, abs=0.01)
    pages = shown(pdf)
    fine = pages[1].shape[1] / sizes_mm(pdf)[1][0]
    lowest = round(pages[1].shape[0] - MARGIN_MM * fine)
    dark = np.flatnonzero(
        pages[1][lowest - 2 : lowest + 3, : round(111 * fine)].max(axis=2).min(axis=0) < 100
    )
    assert np.ptp(dark) / fine == pytest.approx(SCALE_BAR_MM, abs=0.6)
    palm = pieces_of(skin)[0]
    lime = printed_pattern().colour_of_patch[0]
    ink = PRINTED_SRGB[lime - 1].astype(int)
    shares = [np.count_nonzero(np.abs(page.astype(int) - ink).max(axis=2) < 8) for page in pages[1:3]]
    fingertip, wrist = (areas(palm.points_mm, palm.triangles)[palm.patch == patch].sum() for patch in (1, 19))
    # Each whole on a page at least; the colour goes on beyond the seam.
    assert fingertip < max(shares) / fine**2 < 1.8 * (fingertip + wrist)


@pytest.mark.parametrize("paper", PAPERS_MM)
def test_opencv_finds_the_printed_board_and_its_squares(paper: str, tmp_path: Path) -> None:
    sheet, board = board_sheet(paper), CalibrationBoard()
    (page,) = shown(write_sheets(tmp_path, "board", [sheet])[0])
    grey = cv2.cvtColor(page, cv2.COLOR_RGB2GRAY)
    corners, ids, _, markers = cv2.aruco.CharucoDetector(board.opencv).detectBoard(grey)
    assert len(ids) == board.corners
    assert len(markers) == len(board.opencv.getIds())
    box = board_box(sheet)
    inner: list = np.array(board.opencv.getChessboardCorners()).reshape(-1, 3)[:, :2].tolist()
    expected = np.add([inner[int(index)] for index in np.ravel(ids)], (box.left, box.top))
    found = (corners.reshape(-1, 2) + 0.5) * (sheet.width_mm, sheet.height_mm) / page.shape[1::-1]
    assert np.abs(found - expected).max() < 0.1


def test_the_colour_card_has_the_colours_and_a_white(tmp_path: Path) -> None:
    sheet = colour_card("letter")
    (page,) = shown(write_sheets(tmp_path, "card", [sheet])[0])
    wanted = [*PRINTED_SRGB, *([level] * 3 for level in GREYS.values())]
    for field, level in zip(card_fields(sheet), wanted, strict=True):
        cut = page[
            round((field.top + 2) * PIXELS_OF_MM) : round((field.bottom - 2) * PIXELS_OF_MM),
            round((field.left + 2) * PIXELS_OF_MM) : round((field.right - 2) * PIXELS_OF_MM),
        ]
        assert np.abs(cut.astype(int) - np.array(level, dtype=int)).max() <= 1


def test_sheets_are_the_same_each_time(tmp_path: Path) -> None:
    first, second = (write_sheets(tmp_path / name, "card", [colour_card("a4")]) for name in "ab")
    assert [file.read_bytes() for file in first] == [file.read_bytes() for file in second]


def test_what_cannot_be_printed_is_refused() -> None:
    with pytest.raises(BadInput, match="a4, letter"):
        Sheet("a7", "")
    with pytest.raises(BadInput, match="squares of 0 mm"):
        CalibrationBoard(0)
    with pytest.raises(BadInput, match="12 colours; 10 can"):
        glove_sheets(HANDS["assumed"], glove_pattern(HANDS["assumed"], colours=12), "a4")


@pytest.mark.parametrize("skin", HANDS.values(), ids=HANDS)
def test_the_wrists_crease_is_on_both_pieces_and_the_hem_is_told(skin: HandSkin, tmp_path: Path) -> None:
    """Who wears the glove has to see where it belongs: aside, it costs degrees."""
    palm, back = pieces_of(skin)
    for piece in (palm, back):
        line = piece.crease_mm
        across = np.ptp(line.reshape(-1, 2)[:, 0])
        assert np.linalg.norm(line[:, 0] - line[:, 1], axis=1).sum() == pytest.approx(across, rel=0.1)
        assert across > 0.4 * skin.skeleton.dimensions.sizes_mm["hand_breadth"]
        assert piece.hem_mm == pytest.approx(0.07 * skin.skeleton.dimensions.hand_length_mm, abs=1.0)
    sheets = glove_sheets(skin, printed_pattern(), "letter")
    file = write_sheets(tmp_path, "glove", sheets[:1])[0]
    document = pypdfium2.PdfDocument(file)
    text = document[0].get_textpage().get_text_range()
    document.close()
    assert f"the hem {palm.hem_mm:.0f} mm behind it" in " ".join(text.split())
