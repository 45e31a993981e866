"""A card with the glove's colours as this printer prints them, and white and grey to judge the light by."""

from __future__ import annotations

from glovecal_models.colour_glove.palette import COLOUR_NAMES, PRINTED_SRGB
from glovecal_models.colour_glove.sheets.sheet import Box, Sheet

FIELD_MM = 32.0
_GAP_MM = 4.0
_COLUMNS = 4
GREYS = {"white reference (paper)": 255, "grey reference": 119}
"""sRGB levels; 119 reflects 18 % of the light."""


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
