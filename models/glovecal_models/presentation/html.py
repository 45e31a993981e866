"""A presentation as HTML: the body of a page, or what a notebook shows. Every text is escaped."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from html import escape

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
    Section,
    Table,
)
from glovecal_models.presentation.drawing import svg

WIDE_IN = 6.0
"""A picture wider than this is not shrunk below reading size on a narrow screen; it scrolls."""
LONG = 60
"""A cell of more characters wraps."""
NOTEBOOK_STYLE = (
    ".glovecal td, .glovecal th { text-align: right } .glovecal .text { text-align: left }"
    " .glovecal svg { max-width: 100%; height: auto }"
)


def body_html(shown: Presentation) -> str:
    """Title, summary, notes, contents and sections."""
    facts = "".join(
        f"<dt>{escape(item.label)}</dt><dd>"
        f"{f'<code>{escape(item.text)}</code>' if item.is_command else escape(item.text)}</dd>\n"
        for item in shown.summary
    )
    contents = "".join(
        f'<li><a href="#{_anchor(item)}">{escape(item.heading)}</a></li>' for item in shown.shown
    )
    nav = f'<nav aria-label="Contents"><b>Contents</b>\n<ul>{contents}</ul>\n</nav>\n'
    return (
        f'<h1>{escape(shown.title)}</h1>\n<dl class="summary">\n{facts}</dl>\n{parts_html(shown.notes)}'
        f"{nav if len(shown.shown) > 1 else ''}"
        + "".join(
            f'<h2 id="{_anchor(item)}">{escape(item.heading)}</h2>\n{parts_html(item.parts)}'
            for item in shown.shown
        )
    )


def notebook_html(shown: Presentation) -> str:
    """The body, in the notebook's own style; pictures where matplotlib is installed."""
    return f'<div class="glovecal"><style>{NOTEBOOK_STYLE}</style>{body_html(shown)}</div>'


def parts_html(parts: Iterable[Part]) -> str:
    return "".join(f"{part_html(part)}\n" for part in parts)


def part_html(part: Part) -> str:
    match part:
        case Table():
            return table_html(part)
        case Chart():
            return _figure(part)
        case Pictures(charts, are_small):
            return (
                f'<div class="{"multiples" if are_small else "side"}">{"".join(map(_figure, charts))}</div>'
            )
        case Lines(sentences):
            return _listed(sentences)
        case Note(heading, sentences):
            said = counted_once(sentences)
            told = f"<p>{escape(said[0])}</p>" if len(said) == 1 else _listed(said)
            return f'<div class="note">{f"<b>{escape(heading)}</b>" if heading else ""}{told}</div>'
        case Folded(heading, inner):
            return f"<details><summary>{escape(heading)}</summary>{parts_html(inner)}</details>"
        case Block(heading, inner):
            return f'<div class="effect"><h3>{escape(heading)}</h3>{parts_html(inner)}</div>'
        case Explanation(sentence) | str(sentence):
            return f"<p>{escape(sentence)}</p>"


def table_html(table: Table) -> str:
    """Columns with words are set left, numbers right; nothing is left out."""
    if not table.rows:
        return f"<p>{escape(table.empty)}</p>" if table.empty else ""
    words, headings = table.are_words, table.headings

    def cell(tag: str, value: str, is_word: bool) -> str:
        kind = ' class="text prose"' if len(value) > LONG else ' class="text"' if is_word else ""
        return f"<{tag}{kind}>{escape(value)}</{tag}>"

    def row(tag: str, values: Sequence[str]) -> str:
        return f"<tr>{''.join(map(cell, [tag] * len(values), values, words))}</tr>\n"

    head = row("th", headings) if any(headings) else ""
    legend = f"<p>{escape(table.legend)}</p>" if table.legend else ""
    rows = "".join(row("td", values) for values in table.texts)
    return f'<div class="scroll"><table>\n{head}{rows}</table></div>{legend}'


def counted_once(sentences: Sequence[str]) -> list[str]:
    """Sentences alike but for numbers and the takes they name stand once, with how many more there are."""
    alike: dict[str, list[str]] = {}
    for sentence in sentences:
        pattern = re.sub(r"\d+(\.\d+)?", "#", re.sub(r"\b([Tt]ake) \S+", r"\1", sentence))
        alike.setdefault(pattern, []).append(sentence)
    return [
        first if not others else f"{first} ({len(others) + 1} times, this is the first)"
        for first, *others in alike.values()
    ]


def _figure(chart: Chart) -> str:
    wide = ' class="wide"' if chart.width > WIDE_IN else ""
    return (
        f'<figure{wide}><div class="scroll">{svg(chart)}</div>'
        f"<figcaption>{escape(chart.sentence)}</figcaption></figure>"
    )


def _listed(sentences: Sequence[str]) -> str:
    return f"<ul>{''.join(f'<li>{escape(sentence)}</li>' for sentence in sentences)}</ul>"


def _anchor(section: Section) -> str:
    return re.sub(r"[^a-z0-9]+", "-", section.heading.lower()).strip("-") or "section"
