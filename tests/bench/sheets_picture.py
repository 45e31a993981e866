"""The picture of the printed sheets in docs/colour-glove.md, from the sheets themselves.

python tests/bench/sheets_picture.py [FILE]     default docs/pictures/colour-glove-sheets.png
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import cv2
import numpy as np
import pypdfium2

from glovecal_models.colour_glove.pattern import printed_pattern
from glovecal_models.colour_glove.sheets.calibration_board import board_sheet, colour_card
from glovecal_models.colour_glove.sheets.glove_sheets import glove_sheets, patch_sheets
from glovecal_models.colour_glove.sheets.sheet import Sheet, write_sheets
from glovecal_models.colour_glove.skin import hand_skin

FILE = Path(__file__).resolve().parents[2] / "docs" / "pictures" / "colour-glove-sheets.png"
HIGH_PX, GAP_PX = 560, 12


def main(arguments: list[str]) -> None:
    file = Path(arguments[0]) if arguments else FILE
    skin, pattern = hand_skin(), printed_pattern()
    overview, palm, *_ = glove_sheets(skin, pattern, "a4")
    outlines, *_ = patch_sheets(skin, pattern, "a4")
    upright = [_shown(sheet) for sheet in (overview, palm, outlines, colour_card("a4"))]
    board = _shown(board_sheet("a4"))
    gap = np.full((HIGH_PX, GAP_PX, 3), 120, np.uint8)
    row = [part for page in (*upright, board) for part in (page, gap)][:-1]
    cv2.imwrite(str(file), np.hstack(row), [cv2.IMWRITE_PNG_COMPRESSION, 9])


def _shown(sheet: Sheet) -> np.ndarray:
    """(HIGH_PX, W, 3), as PDFium draws the PDF."""
    with tempfile.TemporaryDirectory() as folder:
        document = pypdfium2.PdfDocument(write_sheets(Path(folder), "page", [sheet])[0])
        page = document[0].render(scale=3).to_numpy()[..., :3].copy()
        document.close()
    width = round(page.shape[1] * HIGH_PX / page.shape[0])
    return cv2.resize(page, (width, HIGH_PX), interpolation=cv2.INTER_AREA)


if __name__ == "__main__":
    main(sys.argv[1:])
