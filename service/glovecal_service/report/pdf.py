"""A presentation on paper: A4 pages with numbers; what does not fit wraps, shrinks or goes on overleaf."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import cache
from html import escape
from importlib.metadata import version
from io import BytesIO
from pathlib import Path
from typing import Any

from matplotlib import get_data_path
from reportlab.lib.colors import HexColor
from reportlab.lib.enums import TA_RIGHT
from reportlab.lib.pagesizes import A4
from reportlab.lib.styles import ParagraphStyle
from reportlab.lib.units import inch, mm
from reportlab.pdfbase import pdfmetrics
from reportlab.pdfbase.ttfonts import TTFont
from reportlab.pdfgen.canvas import Canvas
from reportlab.platypus import Flowable, Image, KeepTogether, Paragraph, SimpleDocTemplate, TableStyle
from reportlab.platypus import Table as Grid

from glovecal_models.presentation.document import (
    Block,
    Chart,
    Explanation,
    Folded,
    Lines,
    Note,
    Part,
    Pictures,
    Presentation,
    Table,
)
from glovecal_models.presentation.drawing import CARD, MEASURED, QUIET, png
from glovecal_models.presentation.html import counted_once

MARGIN = 16 * mm
WIDTH = A4[0] - 2 * MARGIN - 12
"""Inside the frame's own padding."""
HIGHEST_PICTURE = 0.8 * (A4[1] - 2 * MARGIN)
"""Below it there is room for its sentence."""
CELL_PADDING = 3.0
FONTS = {"sans": "DejaVuSans", "bold": "DejaVuSans-Bold", "mono": "DejaVuSansMono"}
"""matplotlib brings them: Latin, Greek and Cyrillic letters, degrees and arrows."""
SMALLEST_PT = 5.0
USUAL_WORD = 24
"""Characters; longer words in tables may be broken."""


def pdf_of(shown: Presentation) -> bytes:
    """The whole document."""
    _register_fonts()
    story: list[Flowable] = [_text(shown.title, TITLE)]
    rows = [
        [_text(item.label, QUIET_TEXT), _text(item.text, COMMAND if item.is_command else TEXT)]
        for item in shown.summary
    ]
    if rows:
        card = [("BACKGROUND", (0, 0), (-1, -1), HexColor(CARD)), ("VALIGN", (0, 0), (-1, -1), "TOP")]
        story += [Grid(rows, [0.17 * WIDTH, 0.83 * WIDTH], style=TableStyle(card), splitInRow=1)]
    story += _parts(shown.notes)
    for section in shown.shown:
        story += [_text(section.heading, HEADING), *_parts(section.parts)]
    stream = BytesIO()
    margins = dict.fromkeys(("leftMargin", "rightMargin", "topMargin", "bottomMargin"), MARGIN)
    SimpleDocTemplate(stream, pagesize=A4, title=shown.title, author="Glovecal", **margins).build(
        story, onFirstPage=_numbered, onLaterPages=_numbered
    )
    return stream.getvalue()


def _style(name: str, size: float, font: str = "sans", **more: Any) -> ParagraphStyle:
    more = {"spaceAfter": 4, "textColor": HexColor(MEASURED), **more}
    return ParagraphStyle(name, fontName=FONTS[font], fontSize=size, leading=1.35 * size, **more)


TEXT = _style("text", 9)
QUIET_TEXT = _style("quiet", 9, textColor=HexColor("#55595e"))
COMMAND = _style("command", 8.5, "mono")
TITLE = _style("title", 15, "bold", spaceAfter=8)
HEADING = _style("heading", 12, "bold", spaceBefore=14, spaceAfter=5, keepWithNext=1)
SUBHEADING = _style("subheading", 9.5, "bold", spaceBefore=7, keepWithNext=1)
BULLET = _style("bullet", 9, leftIndent=11, bulletIndent=2)
NOTE = _style("note", 9, backColor=HexColor("#fdf3e3"), borderPadding=3, spaceBefore=6, spaceAfter=6)


@cache
def _register_fonts() -> None:
    for file in FONTS.values():
        pdfmetrics.registerFont(TTFont(file, str(Path(get_data_path()) / "fonts" / "ttf" / f"{file}.ttf")))


def _numbered(canvas: Canvas, _document: object) -> None:
    canvas.setFont(FONTS["sans"], 7.5)
    canvas.drawRightString(A4[0] - MARGIN, 9 * mm, f"{canvas.getPageNumber()}")
    canvas.drawString(MARGIN, 9 * mm, f"Glovecal {version('glovecal-service')}")


def _text(text: str, style: ParagraphStyle = TEXT, bullet: str | None = None) -> Paragraph:
    """Text, never markup; a word that is longer than a line is broken."""
    return Paragraph(escape(text), style, bulletText=bullet)


def _parts(parts: Iterable[Part]) -> list[Flowable]:
    return [flowable for part in parts for flowable in _part(part)]


def _part(part: Part) -> list[Flowable]:
    match part:
        case Table():
            return _table(part)
        case Chart():
            return [KeepTogether(_figure(part, WIDTH))]
        case Pictures(charts):
            return _in_rows(charts)
        case Lines(sentences):
            return [_text(sentence, BULLET, "•") for sentence in sentences]
        case Note(heading, sentences):
            heads = [_text(heading, SUBHEADING)] if heading else []
            return [*heads, *(_text(sentence, NOTE) for sentence in counted_once(sentences))]
        case Folded(heading, inner) | Block(heading, inner):
            return [_text(heading, SUBHEADING), *_parts(inner)]
        case Explanation(sentence) | str(sentence):
            return [_text(sentence)]


def _figure(chart: Chart, width: float) -> list[Flowable]:
    """In its own size where there is room, and its sentence."""
    picture = Image(BytesIO(png(chart)))
    scale = min(
        chart.width * inch / picture.imageWidth,
        width / picture.imageWidth,
        HIGHEST_PICTURE / picture.imageHeight,
    )
    picture.drawWidth, picture.drawHeight = scale * picture.imageWidth, scale * picture.imageHeight
    picture.hAlign = "LEFT"
    return [picture, _text(chart.sentence, QUIET_TEXT)]


def _in_rows(charts: Sequence[Chart]) -> list[Flowable]:
    """As many in a row as have room."""
    if not charts:
        return []
    room = max(1, int(WIDTH // (max(chart.width for chart in charts) * inch)))
    width = WIDTH / room
    rows = [charts[first : first + room] for first in range(0, len(charts), room)]
    cells: list[list[Any]] = [[_figure(chart, width - 12) for chart in row] for row in rows]
    cells[-1] += [""] * (room - len(cells[-1]))
    return [Grid(cells, [width] * room, style=TableStyle([("VALIGN", (0, 0), (-1, -1), "TOP")]))]


def _table(table: Table) -> list[Flowable]:
    """Every row; the headings stand on each page again."""
    if not table.rows:
        return [_text(table.empty)] if table.empty else []
    headings, words = table.headings, table.are_words
    rows = [headings, *table.texts] if any(headings) else table.texts
    size, widths = _fitted(list(zip(*rows, strict=True)))

    def cell(text: str, is_word: bool, is_heading: bool) -> Paragraph:
        more = {} if is_word else {"alignment": TA_RIGHT}
        return _text(text, _style("cell", size, "bold" if is_heading else "sans", spaceAfter=0, **more))

    repeated = int(any(headings))
    cells = [
        [cell(text, is_word, at < repeated) for text, is_word in zip(row, words, strict=True)]
        for at, row in enumerate(rows)
    ]
    look = [
        ("LINEBELOW", (0, 0), (-1, -1), 0.4, HexColor(QUIET)),
        ("VALIGN", (0, 0), (-1, -1), "TOP"),
        *((side, (0, 0), (-1, -1), CELL_PADDING) for side in ("LEFTPADDING", "RIGHTPADDING")),
        *((side, (0, 0), (-1, -1), 1.5) for side in ("TOPPADDING", "BOTTOMPADDING")),
    ]
    grid = Grid(
        cells, widths, repeatRows=repeated, style=TableStyle(look), hAlign="LEFT", splitInRow=1,
        spaceBefore=2, spaceAfter=4,
    )  # fmt: skip
    return [grid, *([_text(table.legend, QUIET_TEXT)] if table.legend else [])]


def _fitted(columns: Sequence[Sequence[str]]) -> tuple[float, list[float]]:
    """Size of letters and widths of columns: each as wide as its longest cell where there is room, else at
    least as its longest word of usual length; where even these have none, letters shrink."""
    size = 8.0
    while True:
        wide = [_widest(column, size) for column in columns]
        words = [[word[:USUAL_WORD] for cell in column for word in cell.split()] for column in columns]
        least = [_widest(column, size) for column in words]
        if sum(wide) <= WIDTH:
            return size, wide
        if sum(least) <= WIDTH or size <= SMALLEST_PT:
            return size, _shared(wide, least)
        size -= 0.5


def _shared(wide: Sequence[float], least: Sequence[float]) -> list[float]:
    """The widest columns give way first."""
    low, high = 0.0, WIDTH
    for _ in range(30):
        middle = (low + high) / 2
        widths = [max(few, min(many, middle)) for few, many in zip(least, wide, strict=True)]
        low, high = (low, middle) if sum(widths) > WIDTH else (middle, high)
    widths = [max(few, min(many, low)) for few, many in zip(least, wide, strict=True)]
    return [width * min(1.0, WIDTH / sum(widths)) for width in widths]


def _widest(texts: Iterable[str], size: float) -> float:
    """Of the bold font, which headings have."""
    longest = max((pdfmetrics.stringWidth(text, FONTS["bold"], size) for text in texts), default=0.0)
    return longest + 2 * CELL_PADDING + 0.5
