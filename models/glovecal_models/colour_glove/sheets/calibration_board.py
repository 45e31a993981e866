"""The board that a camera is calibrated with: a chessboard with markers in its white squares (ChArUco).

S. Garrido-Jurado et al. 2014, "Automatic generation and detection of highly reliable fiducial markers under
occlusion", Pattern Recognition 47(6), 2280-2292; as OpenCV draws and finds it. Corners are known even where
a part of the board is out of the picture.

A card with the glove's colours as this printer prints them, and white and grey to judge the light by.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np

from glovecal_models.colour_glove.pattern import COLOUR_NAMES, PRINTED_SRGB
from glovecal_models.colour_glove.sheets.sheet import Box, Sheet
from glovecal_models.errors import BadInput

COLUMNS, ROWS, SQUARE_MM = 7, 5, 34.0
MARKER_SHARE = 0.75
"""Of a square's side."""
_DICTIONARY = "DICT_4X4_50"
_BITS = 6
"""Of a marker's side, with its black frame."""
SMALLEST_MM, LARGEST_MM = 5.0, 500.0
FIELD_MM = 32.0
_GAP_MM = 4.0
_COLUMNS = 4
GREYS = {"white reference (paper)": 255, "grey reference": 119}
"""sRGB levels; 119 reflects 18 % of the light."""


@dataclass(frozen=True)
class CalibrationBoard:
    """Raises BadInput for a size that no board has. ``square_mm`` is what was measured on the print."""

    square_mm: float = SQUARE_MM

    def __post_init__(self) -> None:
        if not SMALLEST_MM <= self.square_mm <= LARGEST_MM:
            raise BadInput(
                f"squares of {self.square_mm:g} mm; a board has {SMALLEST_MM:g} to {LARGEST_MM:g} mm"
            )

    @property
    def size_mm(self) -> tuple[float, float]:
        return COLUMNS * self.square_mm, ROWS * self.square_mm

    @property
    def corners(self) -> int:
        """Inner corners, those that are looked for."""
        return (COLUMNS - 1) * (ROWS - 1)

    @cached_property
    def opencv(self) -> cv2.aruco.CharucoBoard:
        """For OpenCV; its points are in mm, z away from who looks at the board."""
        dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, _DICTIONARY))
        size = (COLUMNS, ROWS)
        return cv2.aruco.CharucoBoard(size, self.square_mm, MARKER_SHARE * self.square_mm, dictionary)

    def black_boxes_mm(self) -> list[tuple[float, float, float, float]]:
        """Left, top, width, height of everything black, from the board's upper left corner."""
        found = []
        side, marker = self.square_mm, MARKER_SHARE * self.square_mm
        bit, inset = marker / _BITS, (self.square_mm - marker) / 2
        ids = iter(np.ravel(self.opencv.getIds()))
        for row in range(ROWS):
            for column in range(COLUMNS):
                left, top = column * side, row * side
                if (row + column) % 2 == 0:
                    found.append((left, top, side, side))
                    continue
                image = cv2.aruco.generateImageMarker(self.opencv.getDictionary(), int(next(ids)), _BITS)
                for v in range(_BITS):
                    black = np.flatnonzero(image[v] == 0)
                    for run in np.split(black, np.flatnonzero(np.diff(black) > 1) + 1):
                        if len(run):
                            place = (left + inset + run[0] * bit, top + inset + v * bit)
                            found.append((*place, len(run) * bit, bit))
        return found


def board_sheet(paper: str) -> Sheet:
    """The board on one page across."""
    board = CalibrationBoard()
    title = (
        f"Glovecal: camera calibration board (ChArUco {COLUMNS} x {ROWS}, {_DICTIONARY}), "
        f"squares {board.square_mm:g} mm, markers {MARKER_SHARE * board.square_mm:g} mm"
    )
    sheet = Sheet(paper, title, landscape=True)
    (width, _), room = board.size_mm, sheet.room
    left, top = (sheet.width_mm - width) / 2, room.top
    # One shape for all: neighbours drawn one by one leave hair lines between them.
    corners = [
        np.add((left, top), [(x, y), (x + w, y), (x + w, y + h), (x, y + h)])
        for x, y, w, h in board.black_boxes_mm()
    ]
    sheet.shape(corners, fill="black")
    said = (
        "Glue it to something flat and stiff. Measure a square and give the size to\n"
        "glovecal camera calibrate --square-mm."
    )
    sheet.text((sheet.width_mm - 10.0, sheet.height_mm - 10.0), said, size_mm=2.4, anchor="right bottom")
    return sheet


def board_box(sheet: Sheet) -> Box:
    """Where ``board_sheet`` put the board."""
    width, height = CalibrationBoard().size_mm
    left, top = (sheet.width_mm - width) / 2, sheet.room.top
    return Box(left, top, left + width, top + height)


def colour_card(paper: str) -> Sheet:
    """Ten fields of colour in the order of label images, and the references; ``card_fields`` tells where."""
    sheet = Sheet(
        paper, "Glovecal: colour card. Print it with the printer and on the paper or cloth of the glove."
    )
    names = [f"{number} {name}" for number, name in enumerate(COLOUR_NAMES, 1)] + list(GREYS)
    levels = [tuple(int(v) for v in colour) for colour in PRINTED_SRGB] + [(g,) * 3 for g in GREYS.values()]
    for field, name, level in zip(card_fields(sheet), names, levels, strict=True):
        sheet.box(field, fill=tuple(v / 255 for v in level), line="black", width_mm=0.3)
        said = f"{name}\nsRGB {level[0]} {level[1]} {level[2]}"
        sheet.text((field.left, field.bottom + 1.5), said, size_mm=2.8, anchor="left top")
    lowest = card_fields(sheet)[-1].bottom + 16.0
    said = (
        "Hold the card beside the glove, flat, in the same light, without shine or shadow on it.\n"
        "1. All ten fields must be told apart in the camera's picture. If two look alike, print on other\n"
        "    paper or change the light.\n"
        "2. Lock the camera's exposure and white balance. The white field must stay below 250 of 255 in the\n"
        "    picture, and its red, green and blue should be nearly equal.\n"
        "3. A colour cast is taken out of pictures by the white field: keep it plain and unshaded."
    )
    sheet.text((sheet.room.left, lowest), said, size_mm=3.4, anchor="left top")
    return sheet


def card_fields(sheet: Sheet) -> list[Box]:
    """Of the ten colours, white and grey, in this order."""
    top, left = sheet.room.top + 6.0, (sheet.width_mm - _COLUMNS * FIELD_MM - (_COLUMNS - 1) * _GAP_MM) / 2
    found = []
    for index in range(len(COLOUR_NAMES) + len(GREYS)):
        x = left + (index % _COLUMNS) * (FIELD_MM + _GAP_MM)
        y = top + (index // _COLUMNS) * (FIELD_MM + 16.0)
        found.append(Box(x, y, x + FIELD_MM, y + FIELD_MM))
    return found
