"""Every command that a sentence of the product tells a person to type can be typed."""

from __future__ import annotations

import re

from told_commands import COMMAND, complaint, sentences, told, with_samples

PLACEHOLDER = re.compile(r"[A-Z][A-Z_-]*|\.\.\.|\[.*")


def test_commands_that_are_advised_are_taken_by_the_command_line() -> None:
    refused = [
        f"{place}: {line!r}: {problem}"
        for place, text in sentences()
        for line, is_advice in told(text)
        if is_advice and (problem := complaint(with_samples(line)))
    ]
    assert refused == []


def test_commands_that_are_named_exist() -> None:
    lines = {line: place for place, text in sentences() for line, _ in told(text)}
    assert len(lines) > 60  # they are found at all
    for line, place in lines.items():
        words = line.split()[1:]
        assert words[0] in COMMAND.commands, f"{place}: {line!r}"


def test_what_is_no_command_is_refused() -> None:
    assert complaint("glovecal glove wear right --subject anna")
    assert complaint("glovecal capture --glove right")
    assert complaint("glovecal tarin --subject anna")
    assert complaint("glovecal train --subject anna") is None
