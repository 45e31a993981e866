"""A markdown page as steps to run in order: commands with what they print, and files to write.

What a page says to this program stands in comments, which no reader of the rendered page sees:

``<!-- printed by: COMMAND -->``  the next block, which has no command of its own, is what COMMAND prints
``<!-- file: NAME -->``           the next block is a file of this name beside the commands
``<!-- figures vary -->``         the next block holds times or frames of a live stream: only its words count
``<!-- goes on from PAGE -->``    commands find what those of another page left
``<!--`` and lines like those of a block: commands that prepare, with what they print if names are needed

A command with a comment that says ``# needs ...`` is not run, nor is what follows it in its block: it needs
what no computer has by itself.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from markdown_it import MarkdownIt

PROMPT = "$ "
NEEDS = re.compile(r"\s#.*\bneeds ")


@dataclass
class Command:
    """A command, the lines that the page shows below it, and where these stand in the page's lines."""

    text: str
    first: int
    last: int
    promised: list[str] = field(default_factory=list)
    figures_vary: bool = False
    is_run: bool = True

    @property
    def in_background(self) -> bool:
        return self.text.partition(" #")[0].rstrip().endswith("&")


@dataclass(frozen=True)
class File:
    """A block that is a file."""

    name: str
    content: str


@dataclass
class Page:
    """``lines`` of the file; ``unclaimed`` are lines of blocks that no command of the page prints."""

    path: Path
    lines: list[str]
    steps: list[Command | File] = field(default_factory=list)
    goes_on_from: Path | None = None
    unclaimed: list[int] = field(default_factory=list)


def read_page(path: Path) -> Page:
    """Raises OSError."""
    text = path.read_text(encoding="utf-8")
    page = Page(path, text.split("\n"))
    said: dict[str, str] = {}
    for token in MarkdownIt("commonmark").parse(text):
        if token.map is None:
            continue
        if token.type == "html_block":
            said |= _comment(page, token.content, token.map[0])
        elif token.type == "fence":
            _block(page, token.info.strip(), token.content, token.map[0] + 1, said)
            said = {}
    return page


def _comment(page: Page, content: str, line: int) -> dict[str, str]:
    """What a comment says of the next block; preparing commands and the page before go to the page."""
    found = re.fullmatch(r"<!--\s*(.*?)\s*-->\s*", content, re.DOTALL)
    if found is None:
        return {}
    inner = found[1]
    if inner.startswith(PROMPT):
        skipped = content[: content.index(PROMPT)].count("\n")
        page.steps += _commands(inner.split("\n"), line + skipped, vary=False)
        return {}
    if inner == "figures vary":
        return {inner: ""}
    key, _, value = inner.partition(":")
    if key in ("printed by", "file"):
        return {key: value.strip()}
    if inner.startswith("goes on from "):
        page.goes_on_from = (page.path.parent / inner.removeprefix("goes on from ")).resolve()
    return {}


def _block(page: Page, info: str, content: str, first: int, said: dict[str, str]) -> None:
    lines = content.split("\n")[:-1]
    if "file" in said:
        page.steps.append(File(said["file"], content))
    elif "printed by" in said:
        vary = "figures vary" in said
        page.steps.append(Command(said["printed by"], first, first + len(lines), lines, figures_vary=vary))
    elif lines and lines[0].startswith(PROMPT):
        page.steps += _commands(lines, first, vary="figures vary" in said)
    elif not info:
        page.unclaimed += [first + number for number, line in enumerate(lines) if not _is_command(line)]


def _commands(lines: list[str], first: int, *, vary: bool) -> Iterator[Command]:
    is_run = True
    starts = [number for number, line in enumerate(lines) if line.startswith(PROMPT)]
    for start, end in zip(starts, [*starts[1:], len(lines)], strict=True):
        promised = lines[start + 1 : end]
        text = lines[start].removeprefix(PROMPT)
        is_run = is_run and NEEDS.search(text) is None
        yield Command(text, first + start + 1, first + end, promised, figures_vary=vary, is_run=is_run)


def _is_command(line: str) -> bool:
    return (
        re.match(r"\s*(#|$|([A-Z_]+=\S+ )*(glovecal|python3?|uv|pip|sudo|docker|\.venv/bin/)\b)", line)
        is not None
    )
