"""README is short, and every command and option that it and the pages name exists."""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
from functools import cache
from itertools import chain
from pathlib import Path
from typing import Any

import pytest

from glovecal_service.cli.command import command

ROOT = Path(__file__).resolve().parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
COMMAND: Any = command()


def test_the_readme_is_read_in_one_go() -> None:
    shown = re.sub(r"<!--.*?-->\n", "", (ROOT / "README.md").read_text(), flags=re.DOTALL)
    assert len(shown.splitlines()) <= 150


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_commands_and_their_options_exist(page: Path) -> None:
    for line in _commands(page.read_text()):
        command, words = _found(line)
        known = _options(command) | {"--help"}
        for word in words:
            option = word.partition("=")[0]
            if re.fullmatch(r"--?[a-z][a-z-]*", option):
                assert option in known, f"{line!r}: there is no {option}"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_options_named_alone_exist(page: Path) -> None:
    everywhere = _all_options(COMMAND) | _options_of_programs() | {"--help"}
    assert set(re.findall(r"`(--[a-z][a-z-]*)", page.read_text())) <= everywhere


def test_verbs_of_do_py_exist() -> None:
    verbs = subprocess.run([sys.executable, "do.py"], cwd=ROOT, capture_output=True, text=True).stdout
    for page in PAGES:
        for verb in re.findall(r"python3 do\.py ([a-z]+)", page.read_text()):
            assert f"python3 do.py {verb} " in verbs, f"{page.name}: {verb}"


@cache
def _options_of_programs() -> frozenset[str]:
    """Of what has options beside `glovecal`: `do.py` and what it runs, capture, the examples."""
    programs = [ROOT / "do.py", *(ROOT / "client").rglob("*.py"), *(ROOT / "tests").rglob("*.py")]
    found = (re.findall(r'add_argument\(\s*"(--[a-z-]+)"', each.read_text()) for each in programs)
    return frozenset(chain.from_iterable(found))


def _commands(text: str) -> list[str]:
    """Command lines: in blocks, with or without a prompt, and in running text."""
    blocks = re.findall(r"^```[^\n]*\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
    lines = [line for block in blocks for line in block.splitlines()]
    typed = [found[1] for line in lines if (found := re.match(r"(?:\$ |Next: )?(glovecal .*)", line))]
    prose = re.sub(r"^```.*?^```", "", text, flags=re.MULTILINE | re.DOTALL)
    return typed + re.findall(r"`(glovecal [^`]+)`", prose)


def _found(line: str) -> tuple[Any, list[str]]:
    """The command of a line, and the words after it; placeholders in capitals end the way down."""
    command: Any = COMMAND
    words = shlex.split(line, comments=True)[1:]
    while words and getattr(command, "commands", None) and not words[0].startswith("-"):
        if words[0].isupper():
            break
        assert words[0] in command.commands, f"{line!r}: there is no {words[0]}"
        command = command.commands[words.pop(0)]
    return command, words


def _options(command: Any) -> set[str]:
    return {name for each in command.params for name in (*each.opts, *each.secondary_opts)}


def _all_options(command: Any) -> set[str]:
    inner = [_all_options(child) for child in getattr(command, "commands", {}).values()]
    return _options(command).union(*inner)
