"""Pages held against a run of their commands, and rewritten from it."""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from transcripts.lines import NAME, Names, NoLongerPrinted, Tolerance, differs, rewritten
from transcripts.page import Command, File, Page, read_page
from transcripts.shell import ROOT, CommandFailed, Shell

EXACTLY = Tolerance(0.0)
OTHER_CPU = Tolerance(0.01)
"""Kernels of OpenBLAS and NumPy for Haswell, and without AVX, change no printed digit of README's walk, but
identities of models, which are hashes of all digits. Another system's NumPy may come a little further."""
ANY_FIGURE = Tolerance(None)
NO_MORE = "(no more lines)"


@dataclass(frozen=True)
class Difference:
    """A promise of a page that the run did not keep."""

    page: Path
    line: int
    command: str
    promised: str
    printed: str
    needs_a_person: bool = False

    def __str__(self) -> str:
        where = self.page.relative_to(ROOT) if self.page.is_relative_to(ROOT) else self.page
        remedy = (
            "choose the lines to show by hand, then run"
            if self.needs_a_person
            else "if the program is right, write the page with"
        )
        return (
            f"{where}:{self.line}: {self.command}\n  page:    {self.promised}\n  printed: {self.printed}\n"
            f"  {remedy} python3 do.py docs --write {where}"
        )


@dataclass
class Outcome:
    """A page as a run would have it, in the page's names, and where that is not what it says."""

    page: Page
    names: Names
    differences: list[Difference] = field(default_factory=list)
    lines: list[str] = field(default_factory=list)

    @property
    def needs_a_person(self) -> list[Difference]:
        return [each for each in self.differences if each.needs_a_person]

    def write(self) -> None:
        """The page with figures, sentences and names of the run; what needs a person stays as it is."""
        self.page.path.write_text(self.names.in_run("\n".join(self.lines)), encoding="utf-8")


def every_page() -> list[Path]:
    return [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]


def outcomes(
    paths: Sequence[Path],
    tolerance: Tolerance = OTHER_CPU,
    *,
    leave_out: str | None = None,
    tell: Callable[[str], None] = lambda sentence: None,
) -> Iterator[list[Outcome]]:
    """Pages once their commands have run: together those that go on from one another, the first one first.

    Such a page brings those with it that it goes on from. A command that stands in several of them with the
    same words is run once. ``leave_out``: a regular expression of commands that are not run.
    """
    pages = {path: read_page(path) for path in _with_what_they_go_on_from(paths)}
    for path, page in pages.items():
        if page.goes_on_from is not None:
            continue
        with Shell() as shell:
            walk = _Walk(shell, tolerance, leave_out, tell)
            together = [walk.run(each) for each in (page, *_that_go_on(pages, path))]
        yield together


def _with_what_they_go_on_from(paths: Sequence[Path]) -> list[Path]:
    found: dict[Path, None] = {}
    for path in paths:
        before = read_page(path).goes_on_from
        found |= dict.fromkeys([*(_with_what_they_go_on_from([before]) if before else []), path])
    return list(found)


def _that_go_on(pages: dict[Path, Page], path: Path) -> Iterator[Page]:
    for page in pages.values():
        if page.goes_on_from == path:
            yield page
            yield from _that_go_on(pages, page.path)


@dataclass
class _Walk:
    """Pages in one folder; ``answers`` are the lines that commands of the pages before printed."""

    shell: Shell
    tolerance: Tolerance
    leave_out: str | None
    tell: Callable[[str], None]
    names: Names = field(default_factory=Names)
    answers: dict[str, list[str]] = field(default_factory=dict)

    def run(self, page: Page) -> Outcome:
        outcome = Outcome(page, self.names, lines=list(page.lines))
        changes: list[tuple[Command, list[str]]] = []
        answers = dict(self.answers)
        for step in page.steps:
            if isinstance(step, File):
                self.shell.write(step)
            elif step.is_run and not (self.leave_out and re.search(self.leave_out, step.text)):
                started = time.monotonic()
                try:
                    text = self._in_run(step.text)
                    is_known = text in self.answers and not step.in_background
                    answers[text] = self.answers[text] if is_known else self.shell.run(text, step)
                    changes.append((step, self._held_against(step, answers[text], outcome)))
                except CommandFailed as failed:
                    told = Difference(page.path, step.first, step.text, "(runs)", str(failed), True)
                    outcome.differences.append(told)
                self.tell(f"{page.path.name}:{step.first}: {step.text}: {time.monotonic() - started:.1f} s")
        for step, lines in reversed(changes):
            outcome.lines[step.first : step.last] = lines
        self.shell.end_background()
        self.answers = answers
        return outcome

    def _in_run(self, text: str) -> str:
        """A page's command with the names of this run. Raises CommandFailed."""
        for name in re.findall(NAME, text):
            if name not in self.names.here:
                raise CommandFailed(f"{name} is not printed by any command before it")
        return self.names.in_run(text)

    def _held_against(self, command: Command, printed: list[str], outcome: Outcome) -> list[str]:
        """The lines that the page should have; what differs is added to the outcome."""
        if not command.promised:
            return []
        try:
            lines = rewritten(command.promised, printed, self.names)
        except NoLongerPrinted as gone:
            shown = "\n           ".join(["nothing like it, but", *map(self.names.in_page, printed)])
            outcome.differences.append(_difference(outcome, command, gone.place, shown, needs_a_person=True))
            return command.promised
        tolerance = ANY_FIGURE if command.figures_vary else self.tolerance
        for place, (promised, now) in enumerate(_pairs(command.promised, lines)):
            if differs(promised, now, tolerance):
                outcome.differences.append(_difference(outcome, command, place, now))
                return lines
        return command.promised if command.figures_vary else lines


def _difference(
    outcome: Outcome, command: Command, place: int, printed: str, *, needs_a_person: bool = False
) -> Difference:
    """At ``place`` of what the page promises below the command."""
    line = command.first + min(place, len(command.promised) - 1) + 1
    promised = command.promised[place] if place < len(command.promised) else NO_MORE
    return Difference(outcome.page.path, line, command.text, promised, printed, needs_a_person)


def _pairs(promised: list[str], now: list[str]) -> Iterator[tuple[str, str]]:
    """Line beside line; where one has fewer, NO_MORE."""
    for place in range(max(len(promised), len(now))):
        one, other = (lines[place] if place < len(lines) else NO_MORE for lines in (promised, now))
        yield one, other
