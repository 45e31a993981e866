"""Commands that the product tells a person to type: read out of its sentences, and parsed as typed."""

from __future__ import annotations

import ast
import re
import shlex
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

from glovecal_service.cli.command import command

ROOT = Path(__file__).resolve().parents[3]
PRODUCT = ("client/glovecal_client", "models/glovecal_models", "models/glovecal", "service/glovecal_service")
COMMAND: Any = command()
TOLD = re.compile(r"(?<![\w./-])glovecal (?=[a-z])")
END = re.compile(r"[\n`\";,()]| \| |   |\.(?= |$)|[.?]$|'s\b|: |:$")
ADVICE = re.compile(r"(?:[:.] |: `|\n +)$")
"""A command that follows is to be typed: it is whole, and no part of the sentence."""
ARGUMENT = re.compile(r" --|[0-9A-Z]")
FORMATS = ("glovecal hand shape 1", "glovecal hand shape 2", "glovecal cameras 1")
"""First lines of files of ours, which are no commands."""
SAMPLES = {
    "model": "0123456789ab", "short": "0123456789ab", "last": "0123456789ab", "newest": "0123456789ab",
    "parent": "0123456789ab", "id": "0123456789ab", "12": "0123456789ab", "SHORT": "0123456789ab",
    "subject": "anna", "SUBJECT": "anna", "NAME": "anna", "name": "anna", "SOURCE": "camera:0",
    "glove": "right", "hand": "left", "GLOVE": "right", "LENGTH": "190", "seed": "1", "file": "FILE",
    "named": "--take 0123456789ab", "field": "0123456789ab", "effect": "hysteresis",
    "table": "FILE", "layout": "cyberglove18", "LAYOUT": "cyberglove18", "TAKE": "0123456789ab",
    "DEVICE": "simulated", "seconds": "40", "LONG_ENOUGH_S": "60", "method": "lmc_gpr", "needed": "trainer",
    "device": "lucidglove:/dev/ttyUSB0", "kind": "worker",
}  # fmt: skip


def complaint(line: str) -> str | None:
    """What the command line would refuse in ``glovecal ...``; nothing is run."""
    command, context, words = COMMAND, None, shlex.split(line)[1:]
    while words and words[0] in getattr(command, "commands", {}):
        context = type(command).make_context(command, "glovecal", [], resilient_parsing=True)
        command = command.commands[words.pop(0)]
    if words and getattr(command, "commands", None) and not words[0].startswith("-"):
        return f"there is no verb {words[0]}"
    try:
        command.make_context(command.name, words, parent=context)
    except Exception as error:  # whatever click refuses, of whichever copy of click
        return getattr(error, "message", "") or str(error)
    return None


def told(text: str) -> Iterator[tuple[str, bool]]:
    """The commands in a text, and whether each is advice to type it, or only named in a sentence."""
    for found in TOLD.finditer(text):
        rest = text[found.start() :]
        if rest.startswith(FORMATS):
            continue
        end = END.search(rest)
        line = rest[: end.start()] if end else rest
        before = text[: found.start()]
        is_advice = bool(ADVICE.search(before)) or (
            not before and end is None and bool(ARGUMENT.search(rest))
        )
        yield re.sub(r" \.\.\.$", "", line).rstrip(" .?"), is_advice


@cache
def sentences() -> list[tuple[str, str]]:
    """Where each text of the product stands, and the text, with a sample for each value put into it."""
    return list(_sentences())


def _sentences() -> Iterator[tuple[str, str]]:
    for package in PRODUCT:
        for path in sorted((ROOT / package).rglob("*.py")):
            tree = ast.parse(path.read_text(encoding="utf-8"))
            inner = {
                id(part) for node in ast.walk(tree) if isinstance(node, ast.JoinedStr) for part in node.values
            }
            inner |= {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}  # docstrings
            for node in ast.walk(tree):
                if isinstance(node, ast.JoinedStr | ast.Constant) and id(node) not in inner:
                    text = _text(node)
                    if "glovecal " in text:
                        yield f"{path.relative_to(ROOT)}:{node.lineno}", text


def _text(node: ast.AST) -> str:
    if isinstance(node, ast.Constant):
        return node.value if isinstance(node.value, str) else ""
    assert isinstance(node, ast.JoinedStr)
    text = ""
    for part in node.values:
        is_verb = text.endswith("glovecal ")  # the name of a process, no sentence
        value = isinstance(part, ast.FormattedValue)
        text += "VERB" if value and is_verb else _sample(ast.unparse(part.value)) if value else _text(part)
    return text


def _sample(expression: str) -> str:
    words = re.findall(r"\w+", expression)
    sample = next((SAMPLES[word] for word in reversed(words) if word in SAMPLES), "W1")
    return shlex.quote(sample) if "as_typed" in words else sample


def with_samples(line: str) -> str:
    """With a value in the place of each NAME in capitals; a file is there only now: its path may hold what
    ends a command in a sentence."""
    values = SAMPLES | {"FILE": __file__}
    return " ".join(
        shlex.quote(values.get(word, word) if word.isupper() else word) for word in shlex.split(line)
    )
