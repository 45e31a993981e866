"""What the page is made of: pictures over their sentences, tables of texts."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from html import escape

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from glovecal_models.presentation import drawing
from glovecal_models.presentation.document import Chart, Lines
from glovecal_models.presentation.html import part_html

WIDE_PT = 430
"""A picture wider than this is not shrunk below reading size on a narrow screen; it scrolls."""


def svg(draw: Callable[[Axes], object], width: float, height: float) -> str:
    return drawing.svg(Chart(draw, width, height, ""))


def figure_svg(draw: Callable[[Figure], object], width: float, height: float) -> str:
    return drawing.svg(Chart(None, width, height, "", panels=draw))


def figure(picture: str, sentence: str) -> str:
    """A picture (SVG) over what it shows in this data."""
    size = re.search(r'<svg[^>]* width="([\d.]+)pt"', picture)
    wide = ' class="wide"' if size is not None and float(size.group(1)) > WIDE_PT else ""
    shown = f'<div class="scroll">{picture}</div><figcaption>{escape(sentence)}</figcaption>'
    return f"<figure{wide}>{shown}</figure>"


def table(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Columns with words are set left, numbers right."""
    words = [any(row[column][:1].isalpha() for row in rows) for column in range(len(heads))]

    def line(tag: str, cells: Sequence[str]) -> str:
        each = zip(cells, words, strict=True)
        sides = [(cell, ' class="text"' if is_word else "") for cell, is_word in each]
        return f"<tr>{''.join(f'<{tag}{side}>{escape(cell)}</{tag}>' for cell, side in sides)}</tr>"

    lines = "".join(line("td", row) for row in rows)
    return f'<div class="scroll"><table>{line("th", heads)}{lines}</table></div>'


def listed(sentences: Sequence[str]) -> str:
    """Sentences, one below the other."""
    return part_html(Lines(sentences))
