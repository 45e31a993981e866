"""The command reference as Markdown, read from the commands themselves while the site is built."""

from __future__ import annotations

import contextlib
import io
import re
from collections.abc import Iterator, Sequence
from typing import Any

import typer.main

from glovecal_service.cli.command import some_verbs

_SPECIAL = re.compile(r"([\\`*_<>\[\]|{}~#])")


def command_reference() -> str:
    """Every command of ``glovecal``, with its arguments and options as tables (MyST Markdown)."""
    root = typer.main.get_command(some_verbs())
    return "\n\n".join(_described(root, ("glovecal",)))


def plain(text: str) -> str:
    """``text`` so that Markdown shows it as it is, in one line; also inside a table."""
    return _SPECIAL.sub(r"\\\1", " ".join(text.split()))


def code(text: str) -> str:
    """``text`` as code inside a table."""
    return f"`{text.replace('|', chr(92) + '|')}`"


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A Markdown table of cells that are Markdown already."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def _described(command: Any, path: tuple[str, ...]) -> Iterator[str]:
    """``command`` is asked for what it can do, not for its type: typer's own classes are private."""
    context = command.make_context(" ".join(path), [], resilient_parsing=True)
    with contextlib.redirect_stdout(io.StringIO()):
        command.get_help(context)  # some commands put their last lines together only when asked
    children = {name: each for name, each in getattr(command, "commands", {}).items() if not each.hidden}
    yield f"{'#' * (len(path) + 1)} {' '.join(path)}" if len(path) > 1 else "## Usage"
    yield f"```text\n{' '.join((*path, *command.collect_usage_pieces(context)))}\n```"
    yield from _paragraphs(command.help)
    yield from _parameters(command, context)
    yield from _paragraphs(command.epilog)
    if not children:
        return
    yield table(
        ("command", "does"),
        [
            (f"[{' '.join((*path, name))}](#{'-'.join((*path, name))})", plain(child.get_short_help_str(300)))
            for name, child in children.items()
        ],
    )
    for name, child in children.items():
        yield from _described(child, (*path, name))


def _paragraphs(text: str | None) -> Iterator[str]:
    for paragraph in (text or "").split("\n\n"):
        if paragraph.strip():
            yield plain(paragraph)


def _parameters(command: Any, context: Any) -> Iterator[str]:
    for kind in ("argument", "option"):
        records = [
            parameter.get_help_record(context)
            for parameter in command.get_params(context)
            if parameter.param_type_name == kind and parameter.name != "help"
        ]
        rows = [_row(*record) for record in records if record]
        if rows:
            yield table((kind, "value", "meaning"), rows)


def _row(names: str, meaning: str) -> tuple[str, str, str]:
    name, _, value = names.partition(" <")
    choices = [code(choice) for choice in value.removesuffix(">").split("|") if choice]
    return code(name), " ".join(choices), plain(meaning)
