"""What every page is made of: one self-contained HTML file, filled from the templates of this folder.

Text is escaped by the templates; pictures and parts made here are ``Markup`` and stand as they are.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib.metadata import version
from importlib.resources import files
from typing import TYPE_CHECKING, Any

from markupsafe import Markup

if TYPE_CHECKING:
    from jinja2 import Environment

STYLE = (files("glovecal_service.report") / "templates" / "style.css").read_text(encoding="utf-8")
WIDE_PT = 430
"""A picture wider than this is not shrunk below reading size on a narrow screen; it scrolls."""


@dataclass(frozen=True)
class Fact:
    """One line at the head of a page."""

    label: str
    text: str
    is_command: bool = False


@dataclass(frozen=True)
class Section:
    """A heading that the contents list links to, and what stands below it."""

    heading: str
    parts: Sequence[Markup]

    @property
    def anchor(self) -> str:
        return re.sub(r"[^a-z0-9]+", "-", self.heading.lower()).strip("-") or "section"


def page(
    title: str, summary: Sequence[Fact], sections: Sequence[Section], *, notes: Sequence[Markup] = ()
) -> str:
    """A whole page: title, summary, notes, contents and sections. Sections without parts are left out."""
    shown = [section for section in sections if section.parts]
    return render("page.html", title, summary=summary, notes=notes, sections=shown)


def whole_page(title: str, parts: Sequence[str]) -> str:
    """A page with ``parts`` (HTML) in its body as they are."""
    return render("plain.html", title, parts=[Markup(part) for part in parts])


def render(template: str, title: str, **values: Any) -> str:
    """One of the templates, with the style and the version that every page has."""
    filled = {"title": title, "style": Markup(STYLE), "version": version("glovecal-service"), **values}
    return _environment().get_template(template).render(filled)


def figure(picture: str, sentence: str) -> Markup:
    """A picture (SVG) over what it shows in this data."""
    size = re.search(r'<svg[^>]* width="([\d.]+)pt"', picture)
    is_wide = size is not None and float(size.group(1)) > WIDE_PT
    return _part("figure", Markup(picture), sentence, is_wide)


def table(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> Markup:
    """Columns with words are set left, numbers right."""
    return _part("table", heads, rows)


def listed(sentences: Sequence[str]) -> Markup:
    """Sentences, one below the other."""
    return _part("listed", sentences)


def paragraph(sentence: str) -> Markup:
    return _part("paragraph", sentence)


def note(heading: str, sentences: Sequence[str]) -> Markup:
    """Warnings; those that differ in numbers and takes only are one line with a count."""
    return _part("note", heading, counted_once(sentences))


def beside(figures: Sequence[Markup]) -> Markup:
    """Pictures side by side where there is room."""
    return _part("beside", figures)


def multiples(figures: Sequence[Markup]) -> Markup:
    """Small pictures in their own size, as many in a row as there is room for."""
    return _part("multiples", figures)


def folded(heading: str, parts: Sequence[Markup]) -> Markup:
    """What is opened by a click."""
    return _part("folded", heading, parts)


def effect_part(name: str, explanation: str, picture: str | None, parts: Sequence[Markup]) -> Markup:
    """One effect: what it is, how it looks, what was learned."""
    return _part("effect", name, explanation, None if picture is None else Markup(picture), parts)


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


def _part(macro: str, *values: Any) -> Markup:
    return getattr(_environment().get_template("parts.html").module, macro)(*values)


@cache
def _environment() -> Environment:
    from jinja2 import (
        Environment,
        PackageLoader,
        StrictUndefined,
    )  # slow to load, and few commands make a page

    environment = Environment(
        loader=PackageLoader("glovecal_service.report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.globals["are_text"] = _are_text
    return environment


def _are_text(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> list[bool]:
    """For each column whether a cell of it is no number, nor the dash of a missing one."""
    return [any(row[column][:1].isalpha() for row in rows) for column in range(len(heads))]


def counted(count: int, noun: str) -> str:
    """ "1 take", "2 takes"."""
    return f"{count} {noun}{'' if count == 1 else 's'}"


def degrees(value: float | None) -> str:
    """Two decimals, or the dash of a missing number."""
    return "-" if value is None else f"{value:.2f}"


def names_of(items: Sequence[Mapping[str, Any]], most: int = 12) -> str:
    """The names of takes, the first dozen."""
    return ", ".join(str(item["name"]) for item in items[:most]) + (" ..." if len(items) > most else "")
