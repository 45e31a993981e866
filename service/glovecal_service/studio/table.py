"""Tables of a page: a box that scrolls by itself, and rows of plain text, never markup."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager

from nicegui import ui
from nicegui.elements.mixins.text_element import TextElement


@contextmanager
def table(label: str, heads: Sequence[str], kind: str = "", *, caption: str = "") -> Iterator[None]:
    """Rows are made inside the block; ``label``: for screen readers, ``kind``: a class for its style."""
    with ui.element("div").classes("table-box") as box:
        box.props('tabindex="0" role="region"')
        box.props["aria-label"] = label
        with ui.element("table").classes(kind):
            if caption:
                TextElement(tag="caption", text=caption)
            with ui.element("thead"), ui.element("tr"):
                for text in heads:
                    TextElement(tag="th", text=text).props('scope="col"')
            with ui.element("tbody"):
                yield


def row_head(text: str) -> TextElement:
    return TextElement(tag="th", text=text).props('scope="row"')


def cell(text: str) -> TextElement:
    return TextElement(tag="td", text=text)


def text_row(head: str, *cells: str) -> ui.element:
    with ui.element("tr") as row:
        row_head(head)
        for text in cells:
            cell(text)
    return row


def fact_list(facts: Mapping[str, str]) -> dict[str, ui.label]:
    """A number beside each name, and a title that tells what it is; the numbers' labels by name."""
    labels = {}
    with ui.element("ul").classes("glove-facts"):
        for name, what in facts.items():
            with ui.element("li") as item:
                item.props["title"] = what
                ui.label(name).classes("glove-fact")
                labels[name] = ui.label("–").classes("glove-number")
    return labels
