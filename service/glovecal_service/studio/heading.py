"""Headings of a page, which the library does not have, and its buttons."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal

from nicegui import ui
from nicegui.elements.mixins.text_element import TextElement
from nicegui.events import ValueChangeEventArguments


def heading(level: Literal[1, 2, 3], text: str) -> TextElement:
    """Text, never markup."""
    return TextElement(tag=f"h{level}", text=text).classes(
        "studio-heading" if level == 1 else "studio-subheading"
    )


def main_act(text: str, do: Callable[..., Any], *, large: bool = False) -> ui.button:
    """What a page is for; a large one for a hand in a glove."""
    button = (
        ui.button(text, on_click=do).props("unelevated no-caps color=indigo-8").classes("studio-main-act")
    )
    return button.props("size=lg") if large else button


def act(text: str, do: Callable[..., Any]) -> ui.button:
    return ui.button(text, on_click=do).props("outline no-caps").classes("studio-target")


def quiet_act(text: str, do: Callable[..., Any]) -> ui.button:
    """What is seldom wanted."""
    return ui.button(text, on_click=do).props("flat no-caps").classes("studio-target")


def goes_live(changed: Callable[[ValueChangeEventArguments], object] | None = None) -> ui.checkbox:
    """Whether live poses come from a new version at once; not unless it is asked for."""
    return ui.checkbox("Live poses come from it at once", value=False, on_change=changed)
