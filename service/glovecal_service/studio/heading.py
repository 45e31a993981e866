"""Headings of a page; the library has none of its own."""

from __future__ import annotations

from typing import Literal

from nicegui.elements.mixins.text_element import TextElement


def heading(level: Literal[1, 2, 3], text: str) -> TextElement:
    """Text, never markup."""
    return TextElement(tag=f"h{level}", text=text).classes(
        "studio-heading" if level == 1 else "studio-subheading"
    )
