"""What every page is made of: one HTML file that needs nothing else, figures with a sentence, tables."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from importlib.metadata import version

STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; color: #1a1a1a; max-width: 60rem; margin: 2rem auto;
  padding: 0 1rem }
h1 { font-size: 1.5rem } h2 { font-size: 1.15rem; margin-top: 2.2rem }
svg { max-width: 100%; height: auto } figure { margin: 1rem 0 } figcaption { color: #444 }
table { border-collapse: collapse } .note { background: #fdf3e3; padding: .6rem 1rem }
th, td { text-align: right; padding: .15rem .7rem; border-bottom: 1px solid #ddd }
th:first-child, td:first-child, .text { text-align: left } td { white-space: nowrap }
.side { display: flex; flex-wrap: wrap; gap: 1rem } .side figure { flex: 1 1 24rem }
"""


def whole_page(title: str, parts: Sequence[str]) -> str:
    """The page with ``parts`` (HTML) in its body."""
    return (
        f'<!doctype html><html lang="en"><head><meta charset="utf-8"><title>Glovecal: {escape(title)}</title>'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<style>{STYLE}</style></head><body>{''.join(parts)}"
        f"<p>Glovecal {escape(version('glovecal-service'))}.</p></body></html>"
    )


def figure(picture: str, sentence: str) -> str:
    """A picture (SVG) over what it shows in this data."""
    return f"<figure>{picture}<figcaption>{escape(sentence)}</figcaption></figure>"


def table(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Columns with words are set left, numbers right."""
    texts = [any(_is_text(row[column]) for row in rows) for column in range(len(heads))]

    def line(tag: str, cells: Sequence[str]) -> str:
        pairs = zip(cells, texts, strict=True)
        inside = (
            f"<{tag}{' class=text' if is_text else ''}>{escape(cell)}</{tag}>" for cell, is_text in pairs
        )
        return f"<tr>{''.join(inside)}</tr>"

    return f"<table>{line('th', heads)}{''.join(line('td', row) for row in rows)}</table>"


def _is_text(cell: str) -> bool:
    """No number, and not the dash of a missing one."""
    return cell[:1].isalpha()


def listed(sentences: Sequence[str]) -> str:
    """Sentences, one below the other."""
    return "<ul>" + "".join(f"<li>{escape(sentence)}</li>" for sentence in sentences) + "</ul>"
