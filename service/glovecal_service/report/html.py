"""A page: one self-contained HTML file around what ``presentation.html`` makes of an answer."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from importlib.metadata import version
from importlib.resources import files
from typing import TYPE_CHECKING, Any

from markupsafe import Markup

from glovecal_models.presentation.document import Presentation
from glovecal_models.presentation.html import body_html

if TYPE_CHECKING:
    from jinja2 import Environment

STYLE = (files("glovecal_service.report") / "templates" / "style.css").read_text(encoding="utf-8")


def page_of(shown: Presentation) -> str:
    """A whole page: one HTML file that needs nothing else."""
    return whole_page(shown.title, [body_html(shown)])


def whole_page(title: str, parts: Sequence[str]) -> str:
    """A page with ``parts`` (HTML) in its body as they are."""
    return render("plain.html", title, parts=[Markup(part) for part in parts])


def render(template: str, title: str, **values: Any) -> str:
    """One of the templates, with the style and the version that every page has."""
    filled = {"title": title, "style": Markup(STYLE), "version": version("glovecal-service"), **values}
    return _environment().get_template(template).render(filled)


@cache
def _environment() -> Environment:
    from jinja2 import (
        Environment,
        PackageLoader,
        StrictUndefined,
    )  # slow to load, and few commands make a page

    return Environment(
        loader=PackageLoader("glovecal_service.report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
