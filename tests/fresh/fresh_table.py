"""What the two commands of README said on a bare system, as a row of a table, and the table in a page."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

BEGIN = "<!-- fresh: written by python3 do.py fresh --page -->"
END = "<!-- fresh: end -->"
_VERDICT = re.compile(r"^((?:Right|Partly right|Wrong): .*)$", re.MULTILINE)
_COUNTS = re.compile(r"^=+ (.*\d+ (?:passed|failed|errors?).*) in [\d.]+s", re.MULTILINE)


@dataclass(frozen=True)
class Outcome:
    """How a command ended: in one sentence, whether as it should, and after how many seconds."""

    said: str
    passed: bool
    seconds: float

    def cell(self) -> str:
        return (
            f"{self.said}, {self.seconds:,.0f} s"
            if self.passed
            else f"**{self.said}**, {self.seconds:,.0f} s"
        )


@dataclass(frozen=True)
class Row:
    """A bare system, and what became of the commands there."""

    suite: str
    python: str
    installed: Sequence[str]
    outcomes: Sequence[Outcome]

    @property
    def passed(self) -> bool:
        return all(outcome.passed for outcome in self.outcomes)


def demo_outcome(code: int | None, text: str, seconds: float) -> Outcome:
    """The demo passes where it ends well and tells of nothing wrong that it named."""
    verdicts = _VERDICT.findall(text)
    if code != 0 or not verdicts:
        return _ended_badly(code, seconds)
    return Outcome(verdicts[-1].rstrip("."), "Wrong" not in verdicts[-1], seconds)


def suite_outcome(code: int | None, text: str, seconds: float) -> Outcome:
    """The suite passes where pytest says so; skipped tests are counted beside."""
    counts = _COUNTS.findall(text)
    if code is None or not counts:
        return _ended_badly(code, seconds)
    return Outcome(counts[-1], code == 0, seconds)


def _ended_badly(code: int | None, seconds: float) -> Outcome:
    said = "did not end in the time it was given" if code is None else f"ended with code {code}"
    return Outcome(said, False, seconds)


def table(rows: Sequence[Row], commands: Sequence[str]) -> str:
    """Markdown: a row for each system."""
    heads = ["Debian", "Python", "installed beside the base", *(f"`{command}`" for command in commands)]
    lines = [heads, ["---"] * len(heads)]
    for row in rows:
        cells = [outcome.cell() for outcome in row.outcomes]
        lines.append([row.suite, row.python, ", ".join(row.installed), *cells])
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def around_table(page: Path) -> tuple[str, str]:
    """What stands before and behind the two marks. Raises ValueError where a mark is missing."""
    before, begin, rest = page.read_text(encoding="utf-8").partition(BEGIN)
    _, end, after = rest.partition(END)
    if not begin or not end:
        raise ValueError(f"{page} has no place for the table: write {BEGIN} and {END} into it")
    return before, after


def put_into_page(page: Path, text: str) -> None:
    """Between the two marks, in place of what stands there. Raises ValueError where a mark is missing."""
    before, after = around_table(page)
    page.write_text(f"{before}{BEGIN}\n{text}\n{END}{after}", encoding="utf-8")
