"""The glove on paper: both pieces at full size over several pages, in colour or as outlines; an overview."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import groupby

import cv2
import numpy as np
from matplotlib.path import Path as Curve

from glovecal_models.colour_glove.pattern import COLOUR_NAMES, PRINTED_SRGB, Pattern
from glovecal_models.colour_glove.sheets.flat_glove import FlatPiece, flat_pieces
from glovecal_models.colour_glove.sheets.sheet import GREY, MARGIN_MM, Box, Sheet
from glovecal_models.colour_glove.skin import HandSkin
from glovecal_models.errors import BadInput

SEAM_ALLOWANCE_MM = 6.0
BLEED_MM = 4.0
"""Colour goes on so far beyond the seam."""
OVERLAP_MM = 14.0
"""That neighbouring pages share."""
_BESIDE_MM = 9.0
"""Around the cut, for numbers."""
_MARKS = "ABCDEFGHJKLMNPRSTUVWXYZ"
"""Along the seam: each stands at the same place on both pieces."""
_OVERVIEW_SCALE = 0.4


def glove_sheets(skin: HandSkin, pattern: Pattern, paper: str) -> list[Sheet]:
    """An overview, then both pieces in colour. Raises BadInput for a paper or pattern that does not fit."""
    pieces = _marked_pieces(skin, pattern)
    full = [sheet for piece in pieces for sheet in _tiled(piece, pattern, paper, coloured=True)]
    return [_overview(pieces, skin, pattern, paper, len(full)), *full]


def patch_sheets(skin: HandSkin, pattern: Pattern, paper: str) -> list[Sheet]:
    """Both pieces as outlines with numbers, to paint a bought glove by or to cut iron-on patches."""
    pieces = _marked_pieces(skin, pattern)
    return [sheet for piece in pieces for sheet in _tiled(piece, pattern, paper, coloured=False)]


@dataclass(frozen=True, eq=False)
class _MarkedPiece:
    piece: FlatPiece
    cut_mm: list[np.ndarray]
    """Outlines, seam allowance included."""
    marks: list[tuple[str, np.ndarray, np.ndarray]]
    """Letter, place on the seam and direction outwards."""


def cut_line(piece: FlatPiece) -> list[np.ndarray]:
    """Closed lines (N, 2), ``SEAM_ALLOWANCE_MM`` outside seam and opening."""
    from skimage.measure import find_contours

    fine = 4.0  # pixels a mm
    outline = piece.outline_mm
    low = outline.min(axis=0) - SEAM_ALLOWANCE_MM - 2.0
    width, height = np.ceil((np.ptp(outline, axis=0) + 2 * SEAM_ALLOWANCE_MM + 4.0) * fine).astype(int)
    shown = np.zeros((height, width), np.uint8)
    cv2.fillPoly(shown, [np.rint((outline - low) * fine).astype(np.int32)], 1)
    away = cv2.distanceTransform(1 - shown, cv2.DIST_L2, cv2.DIST_MASK_PRECISE) / fine
    found = [contour[:, ::-1] / fine + low for contour in find_contours(away, SEAM_ALLOWANCE_MM)]
    return [line[:-1:3] for line in found if np.ptp(line, axis=0).max() > 3 * SEAM_ALLOWANCE_MM]


def seam_marks(palm: FlatPiece, back: FlatPiece, count: int = len(_MARKS)) -> list[tuple[int, int]]:
    """Places on both outlines that are sewn onto each other: indices into ``outline_mm`` of each, evenly
    along the palm's seam."""
    of_back = {key: index for index, key in enumerate(_keys(back))}
    seam = [(index, of_back[key]) for index, key in enumerate(_keys(palm)) if key in of_back]
    points = palm.outline_mm[[index for index, _ in seam]]
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    wanted = (np.arange(count) + 0.5) / count * along[-1]
    return [seam[int(np.argmin(np.abs(along - place)))] for place in wanted]


def _keys(piece: FlatPiece) -> list[tuple[float, ...]]:
    """The outline's points on the skin, comparable between both pieces."""
    return [tuple(np.round(point, 6)) for point in piece.outline_on_skin_mm]


def _marked_pieces(skin: HandSkin, pattern: Pattern) -> list[_MarkedPiece]:
    if pattern.colours > len(COLOUR_NAMES):
        raise BadInput(f"{pattern.colours} colours; {len(COLOUR_NAMES)} can be printed and told apart")
    pieces = flat_pieces(skin, pattern)
    cuts = [cut_line(piece) for piece in pieces]
    places = [(piece.outline_mm, _outwards(piece.outline_mm)) for piece in pieces]
    pairs = [
        pair
        for pair in seam_marks(*pieces)
        if all(
            _is_free(outline[at], outwards[at], cut)
            for at, (outline, outwards), cut in zip(pair, places, cuts, strict=True)
        )
    ]
    found = []
    for column, (piece, cut, (outline, outwards)) in enumerate(zip(pieces, cuts, places, strict=True)):
        named = zip(_MARKS, pairs, strict=False)
        marks = [(letter, outline[pair[column]], outwards[pair[column]]) for letter, pair in named]
        found.append(_MarkedPiece(piece, cut, marks))
    return found


def _is_free(place: np.ndarray, outwards: np.ndarray, cut: list[np.ndarray]) -> bool:
    """Whether there is room to write beside the cut: between fingers there may be none."""
    beside = place + outwards * np.arange(SEAM_ALLOWANCE_MM + 1.0, SEAM_ALLOWANCE_MM + 7.0)[:, None]
    return not any(Curve(line).contains_points(beside).any() for line in cut)


def _outwards(outline: np.ndarray, reach: int = 4) -> np.ndarray:
    """(N, 2) directions of length 1 at the points of a closed line."""
    along = np.roll(outline, -reach, axis=0) - np.roll(outline, reach, axis=0)
    x, y = outline.T
    turns = np.sign(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))
    normal = turns * np.column_stack([along[:, 1], -along[:, 0]])
    return normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-9)


def _tiled(marked: _MarkedPiece, pattern: Pattern, paper: str, *, coloured: bool) -> Iterator[Sheet]:
    """One piece over as few pages as it needs."""
    points = np.concatenate(marked.cut_mm)
    low, high = points.min(axis=0) - _BESIDE_MM, points.max(axis=0) + _BESIDE_MM
    layouts = []
    for landscape in (False, True):
        room = Sheet(paper, "", landscape=landscape).room
        size = np.array([room.right - room.left, room.bottom - room.top])
        count = np.maximum(1, np.ceil((high - low - OVERLAP_MM) / (size - OVERLAP_MM))).astype(int)
        layouts.append((int(count.prod()), landscape, room, size, count))
    pages, landscape, room, size, count = min(layouts, key=lambda layout: layout[:2])
    # Pages share more than they must, evenly.
    steps = (high - low - size) / np.maximum(count - 1, 1)
    corner = np.where(count == 1, (low + high - size) / 2, low)
    kind = "in colour" if coloured else "outlines and numbers"
    for row in range(count[1]):
        for column in range(count[0]):
            number = row * count[0] + column + 1
            where = f", page {number} of {pages}" if pages > 1 else ""
            side = marked.piece.side
            title = f"Glovecal colour glove: {side} side, {kind}{where}"
            sheet = Sheet(paper, title, landscape=landscape)
            shift = np.array([room.left, room.top]) - (corner + (column, row) * steps)
            _draw(sheet, marked, pattern, shift, coloured)
            _register(sheet, shift, corner, size, steps, count, (column, row))
            yield sheet


def _draw(sheet: Sheet, marked: _MarkedPiece, pattern: Pattern, shift: np.ndarray, coloured: bool) -> None:
    piece, room = marked.piece, sheet.room
    for patch in np.unique(piece.patch):
        loops = [loop + shift for loop in piece.patch_outlines_mm(int(patch))]
        if coloured:
            ink = printed(pattern, int(patch))
            sheet.shape(loops, line=ink, width_mm=2 * BLEED_MM, within=room, layer=1)
            sheet.shape(loops, fill=ink, within=room, layer=2)
        else:
            sheet.shape(loops, line="black", width_mm=0.2, within=room)
            place, free = _roomiest(piece, int(patch))
            place = place + shift
            name = COLOUR_NAMES[pattern.colour_of_patch[patch - 1] - 1]
            said = f"{patch}\n{name}" if free > 7 else f"{patch}"
            if _inside(place, room):
                sheet.text(tuple(place), said, size_mm=3.0 if free > 7 else 2.2, anchor="center center")
    for line in marked.cut_mm:
        sheet.shape([line + shift], line=GREY, width_mm=0.3, within=room, layer=4)
    sheet.shape([piece.outline_mm + shift], line="black", width_mm=0.35, dashed=True, within=room, layer=4)
    for ends in piece.crease_mm + shift:
        if _inside(ends[0], room) and _inside(ends[1], room):
            sheet.line(ends, width_mm=0.4)
    for letter, place, outwards in marked.marks:
        ends = np.array([place, place + SEAM_ALLOWANCE_MM * outwards]) + shift
        if _inside(ends[0], room) and _inside(ends[1], room):
            sheet.line(ends, width_mm=0.3)
            sheet.text(
                tuple(ends[1] + 1.8 * outwards), letter, size_mm=2.4, anchor="center center", colour=GREY
            )
    for patch, place, outwards in _beside(piece):
        if not _is_free(place, outwards, marked.cut_mm):
            continue
        near, far = (
            place + mm * outwards + shift for mm in (SEAM_ALLOWANCE_MM + 0.8, SEAM_ALLOWANCE_MM + 4.6)
        )
        if _inside(far, room):
            sheet.line(np.array([near, near + 1.5 * outwards]), width_mm=0.2)
            sheet.text(tuple(far), str(patch), size_mm=3.2, bold=True, anchor="center center")


def _register(
    sheet: Sheet, shift: np.ndarray, corner: np.ndarray, size: np.ndarray, steps: np.ndarray,
    count: np.ndarray, place: tuple[int, int],
) -> None:  # fmt: skip
    """Crosses and trimming lines in the middle of what neighbouring pages share."""
    room = sheet.room
    for axis in (0, 1):
        other = 1 - axis
        for seam in range(count[axis] - 1):
            if seam not in (place[axis] - 1, place[axis]):
                continue
            middle = corner[axis] + (seam + 1) * steps[axis] + (size[axis] - steps[axis]) / 2
            low = corner[other] + place[other] * steps[other]
            ends = np.empty((2, 2))
            ends[:, axis], ends[:, other] = middle, (low, low + size[other])
            sheet.line(ends + shift, width_mm=0.15, colour=GREY, dashed=True)
            for number, share in enumerate((0.06, 0.94), 1):
                mark = np.empty(2)
                mark[axis], mark[other] = middle, low + share * size[other]
                sheet.cross(tuple(mark + shift), f"{'xy'[axis]}{seam + 1}.{number}")
    if count.prod() > 1:
        said = "Trim one page along the grey dashed\nline, lay cross on cross, tape."
        sheet.text((room.right, sheet.height_mm - MARGIN_MM), said, size_mm=2.6, anchor="right bottom")


def _overview(pieces: list[_MarkedPiece], skin: HandSkin, pattern: Pattern, paper: str, pages: int) -> Sheet:
    hand, length = skin.skeleton.hand, skin.skeleton.dimensions.hand_length_mm
    title = f"Glovecal colour glove: {hand} hand, {length:g} mm from wrist to middle fingertip"
    sheet = Sheet(paper, title)
    room = sheet.room
    half = (room.right - room.left) / 2
    lowest = room.top
    for column, marked in enumerate(pieces):
        points = np.concatenate(marked.cut_mm) * _OVERVIEW_SCALE
        middle = room.left + (column + 0.5) * half
        shift = np.array(
            [middle - (points[:, 0].min() + points[:, 0].max()) / 2, room.top + 6 - points[:, 1].min()]
        )
        said = f"{marked.piece.side} side, seen from outside"
        sheet.text((middle, room.top), said, size_mm=3.2, anchor="center top")
        _small(sheet, marked.piece, pattern, shift)
        lowest = max(lowest, points[:, 1].max() + shift[1])
    top = lowest + 8.0
    for patch in range(1, len(pattern.colour_of_patch) + 1):
        column, row = divmod(patch - 1, -(-len(pattern.colour_of_patch) // 4))
        x, y = room.left + column * half / 2, top + row * 6.0
        colour = int(pattern.colour_of_patch[patch - 1])
        sheet.box(Box(x, y, x + 6.0, y + 4.2), fill=printed(pattern, patch), line="black", width_mm=0.15)
        sheet.text(
            (x + 7.5, y + 2.1), f"{patch}  {COLOUR_NAMES[colour - 1]}", size_mm=3.0, anchor="left center"
        )
    rows = -(-len(pattern.colour_of_patch) // 4)
    y = top + rows * 6.0 + 4.0
    for heading, lines in _INSTRUCTIONS:
        sheet.text((room.left, y), heading, size_mm=3.0, bold=True, anchor="left top")
        text = lines.format(pages=pages, hem_mm=pieces[0].piece.hem_mm)
        sheet.text((room.left + 16.0, y), text, size_mm=3.0, anchor="left top")
        y += 4.3 * (lines.count("\n") + 1) + 2.5
    return sheet


_INSTRUCTIONS = (
    (
        "Print",
        "At 100 %; measure the 100 mm bar on a page. The {pages} pages after this one are at full size.",
    ),
    (
        "Sew",
        "Print these pages onto printable cotton sheets; or onto transfer film (switch on “mirror”\n"
        "when printing) and iron it onto light stretch cloth.\n"
        "1. Join the pages of a piece, cross on cross. Cut along the grey line.\n"
        "2. Lay both pieces on each other, printed sides inside. Pin A to A, B to B and so on.\n"
        "3. Sew along the dashed line with a small elastic stitch. If the cloth does not stretch, leave\n"
        "    5 cm open above the wrist at the little finger's side.\n"
        "4. Cut between the fingers up to 2 mm from the seam, turn, hem the opening.",
    ),
    (
        "Iron on",
        "Cut patches from coloured iron-on film by patches.pdf (film is cut from its back: mirror it)\n"
        "and iron them onto a plain, close-fitting white glove, number beside number.",
    ),
    (
        "Paint",
        "Pull a plain white glove over a card in the shape of the hand. Trace the lines of patches.pdf\n"
        "and paint each patch with matt textile paint in the colour of its number.",
    ),
    (
        "Wear",
        "The black line lies in the crease of the wrist, the hem {hem_mm:.0f} mm behind it, the seams along\n"
        "the fingers' sides, the tips without folds. A glove that lies aside costs degrees: look each time.",
    ),
    (
        "Check",
        "A patch that crosses the seam has one number and one colour on both sides. Use matt colours:\n"
        "shine looks white to a camera. Borders may be drawn smoother than they are printed. Hold the\n"
        "glove beside the colour card: all ten colours must be told apart in the camera's picture.",
    ),
)


def _small(sheet: Sheet, piece: FlatPiece, pattern: Pattern, shift: np.ndarray) -> None:
    for patch in np.unique(piece.patch):
        loops = [loop * _OVERVIEW_SCALE + shift for loop in piece.patch_outlines_mm(int(patch))]
        ink = printed(pattern, int(patch))
        sheet.shape(loops, fill=ink, line="black", width_mm=0.1)
        place, free = _roomiest(piece, int(patch))
        if free > 4:
            dark = np.dot(ink, (0.3, 0.59, 0.11)) < 0.5
            sheet.text(
                tuple(place * _OVERVIEW_SCALE + shift), str(patch), size_mm=2.8, bold=True,
                anchor="center center", colour="white" if dark else "black",
            )  # fmt: skip
    sheet.shape([piece.outline_mm * _OVERVIEW_SCALE + shift], line="black", width_mm=0.25)


def printed(pattern: Pattern, patch: int) -> tuple[float, ...]:
    """A patch's colour as the drawing library takes it, 0 to 1."""
    return tuple(float(value) / 255 for value in PRINTED_SRGB[pattern.colour_of_patch[patch - 1] - 1])


def _beside(piece: FlatPiece) -> list[tuple[int, np.ndarray, np.ndarray]]:
    """Patch, place, direction outwards: the middle of each patch's parts of the outline."""
    outline, outwards = piece.outline_mm, _outwards(piece.outline_mm)
    owner = piece.patch_along_outline
    turn = int(np.flatnonzero(owner != np.roll(owner, 1))[0]) if len(set(owner)) > 1 else 0
    order = np.roll(np.arange(len(owner)), -turn)
    found = []
    for patch, run in groupby(order, key=lambda index: owner[index]):
        places = list(run)
        length = np.linalg.norm(np.diff(outline[places], axis=0), axis=1).sum()
        if length > 8.0:
            middle = places[len(places) // 2]
            found.append((int(patch), outline[middle], outwards[middle]))
    return found


def _roomiest(piece: FlatPiece, patch: int) -> tuple[np.ndarray, float]:
    """The place in a patch that is farthest from its borders, and how far, mm."""
    chosen = piece.triangles[piece.patch == patch]
    middles = piece.points_mm[chosen].mean(axis=1)
    border = np.concatenate(piece.patch_outlines_mm(patch))
    away = np.linalg.norm(middles[:, None] - border[None], axis=2).min(axis=1)
    return middles[int(np.argmax(away))], float(away.max())


def _inside(place: np.ndarray, room: Box) -> bool:
    return bool(room.left <= place[0] <= room.right and room.top <= place[1] <= room.bottom)
