"""What a page promises beside what was printed: the same words, figures within a tolerance, names by meaning.

A page's output may be shortened: a line of ``...`` stands for any lines, or none (which of a
stream's lines is the page's is a matter of chance); ``...`` in a line stands for any text.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from difflib import SequenceMatcher

ELISION = "..."
NAME = r"\b[0-9a-f]{64}\b|\b[0-9a-f]{12}\b|(?<=/)glovecal-[a-z0-9_]{3,}"
"""What is drawn or hashed anew in each run: identities of takes and models, temporary folders."""
DATE = r"\b\d{4}-\d\d-\d\d(?:[ T]\d\d:\d\d(?::\d\d)?)?"
FIGURE = r"(?<![\w.])[-+]?\d+(?:\.\d+)?(?!\w)(?: %)?"
PIECE = re.compile(
    rf"(?P<elision>\.\.\.)|(?P<name>{NAME})|(?P<date>{DATE})|(?P<figure>{FIGURE})|(?P<gap>\s+)"
)
SHORT = 6
"""Characters to which a table cuts a model's identity."""
ALIKE = 0.6
LETTERS_ALIKE = 0.75
"""Share of words, or of letters, in common from which a line that has changed is still that of the page."""


class NoLongerPrinted(Exception):
    """A line of a page that nothing printed comes near to; holds the line's place in the promised output."""

    def __init__(self, place: int) -> None:
        super().__init__(place)
        self.place = place


@dataclass
class Names:
    """Names of a page and what they are in this run; a page keeps its names, so that it changes little."""

    here: dict[str, str] = field(default_factory=dict)

    def learn(self, of_page: str, printed: str) -> None:
        if of_page not in self.here and printed not in self.here.values():
            self.here[of_page] = printed

    def in_run(self, text: str) -> str:
        return _translated(text, self.here)

    def in_page(self, text: str) -> str:
        return _translated(text, {printed: of_page for of_page, printed in self.here.items()})


def _translated(text: str, names: dict[str, str]) -> str:
    cut = {name[:SHORT]: other[:SHORT] for name, other in names.items() if re.match("[0-9a-f]{12}", name)}
    anywhere = rf"{NAME}|\b[0-9a-f]{{{SHORT}}}\b"
    return re.sub(anywhere, lambda found: (cut | names).get(found[0], found[0]), text)


@dataclass(frozen=True)
class Tolerance:
    """How far a figure may be from the page's: a share of it, or 1.5 of its last digit.

    A whole number that is no percentage counts something and is the same. ``share`` None: any figure will do.
    """

    share: float | None

    def allows(self, promised: str, printed: str) -> bool:
        if self.share is None:
            return True
        bare = [figure.removesuffix(" %") for figure in (promised, printed)]
        if promised == bare[0] and "." not in promised:
            return promised == printed
        digits = [len(figure.partition(".")[2]) for figure in bare]
        one, other = map(float, bare)
        if digits[0] != digits[1] and min(abs(one), abs(other)) >= 1:  # below 1: up to three digits
            return False
        last_digit = 10.0 ** -max(digits)
        return abs(one - other) <= max(self.share * abs(one), 1.5 * last_digit if self.share else 0.0)


def rewritten(promised: Sequence[str], printed: Sequence[str], names: Names) -> list[str]:
    """``promised`` with what was printed now: shortened in the same places, by the names of the page.

    Learns names that ``promised`` has for the first time. Raises NoLongerPrinted.
    """
    places = _aligned(promised, [line.rstrip() for line in printed], names)
    for number, place in places.items():
        _learn(promised[number], printed[place], names)
    written: list[str] = []
    end = 0
    for group in _groups(promised):
        at = [places[number] for number in group.numbers if number in places]
        for number in _chosen(group, promised):
            if number not in places:
                raise NoLongerPrinted(number)
        first = min(at) if group.elision is not None else end
        last = max(at) if group.is_cut else len(printed) - 1
        if group.elision is not None:
            written.append(group.elision)
        lines_here = {places[number]: number for number in group.numbers if number in places}
        for place in range(first, last + 1):
            line = printed[place].rstrip()
            if place in lines_here and ELISION in promised[lines_here[place]]:
                line = _shortened(promised[lines_here[place]], line, names)
            written.append(names.in_page(line))
        end = last + 1
    if promised and is_elision(promised[-1]):
        written.append(promised[-1])
    return written


def _chosen(group: _Group, promised: Sequence[str]) -> list[int]:
    """Lines that somebody chose from the printed ones: beside an elision, or with one in them."""
    shown = [number for number in group.numbers if promised[number].strip()]
    beside = [*(shown[:1] if group.elision is not None else ()), *(shown[-1:] if group.is_cut else ())]
    return [*beside, *(number for number in shown if ELISION in promised[number])]


def differs(promised: str, now: str, tolerance: Tolerance) -> bool:
    """Whether a line and what ``rewritten`` made of it differ by more than the tolerance allows."""
    pieces = [list(_pieces(line.strip())) for line in (promised, now)]
    if len(pieces[0]) != len(pieces[1]):
        return True
    for (kind, text), (other_kind, other) in zip(*pieces, strict=True):
        if kind != other_kind:
            return True
        if kind == "figure":
            if not tolerance.allows(text, other):
                return True
        elif kind not in ("gap", "date") and text != other:
            return True
    return False


def is_elision(line: str) -> bool:
    return line.strip() == ELISION


@dataclass
class _Group:
    """Lines of a page between two elisions; ``elision`` is the line before them, None at the beginning."""

    elision: str | None
    numbers: list[int]
    is_cut: bool = False


def _groups(promised: Sequence[str]) -> list[_Group]:
    groups = [_Group(None, [])]
    for number, line in enumerate(promised):
        if is_elision(line):
            groups[-1].is_cut = True
            groups.append(_Group(line, []))
        else:
            groups[-1].numbers.append(number)
    return [group for group in groups if group.numbers]


def _aligned(promised: Sequence[str], printed: Sequence[str], names: Names) -> dict[int, int]:
    """Which printed line each promised line is: in order, as much alike as possible together."""
    wanted = [number for number, line in enumerate(promised) if not is_elision(line)]
    best = [[0.0] * (len(printed) + 1) for _ in range(len(wanted) + 1)]
    alike = [[_likeness(names.in_run(promised[number]), line) for line in printed] for number in wanted]
    for row in range(len(wanted) - 1, -1, -1):
        for place in range(len(printed) - 1, -1, -1):
            taken = alike[row][place] + best[row + 1][place + 1] if alike[row][place] else 0.0
            best[row][place] = max(taken, best[row + 1][place], best[row][place + 1])
    places: dict[int, int] = {}
    row = place = 0
    while row < len(wanted) and place < len(printed):
        taken = alike[row][place] + best[row + 1][place + 1] if alike[row][place] else 0.0
        if taken and taken >= max(best[row + 1][place], best[row][place + 1]):
            places[wanted[row]] = place
            row, place = row + 1, place + 1
        elif best[row][place + 1] >= best[row + 1][place]:
            place += 1
        else:
            row += 1
    return places


def _likeness(promised: str, printed: str) -> float:
    """0: another line; above 1: the same words, more the nearer the figures are."""
    if not promised.strip() or not printed.strip():
        return 0.01 * (promised.strip() == printed.strip())
    found = re.fullmatch(_pattern(promised), printed)
    if found is not None:
        texts = [text for kind, text in _pieces(promised) if kind in ("name", "date", "figure")]
        same = sum(text == other for text, other in zip(texts, found.groups(), strict=True))
        return 1 + same / (1 + len(texts))
    if ELISION in promised:
        return 0.0
    words = [[text for kind, text in _pieces(line) if kind != "gap"] for line in (promised, printed)]
    ratio = SequenceMatcher(None, *words, autojunk=False).ratio()
    letters = SequenceMatcher(None, promised.strip(), printed.strip(), autojunk=False)
    if ratio < ALIKE <= LETTERS_ALIKE <= letters.quick_ratio():
        ratio = letters.ratio() if letters.ratio() >= LETTERS_ALIKE else 0.0
    return ratio if ratio >= ALIKE else 0.0


def _pattern(promised: str) -> str:
    """Matches a printed line of the same words; its groups are names, dates and figures in their order."""
    parts = {
        "elision": ".*?",
        "name": f"({NAME})",
        "date": f"({DATE})",
        "figure": f"({FIGURE})",
        "gap": r"\s+",
    }
    inner = "".join(parts.get(kind) or re.escape(text) for kind, text in _pieces(promised.strip()))
    return rf"\s*{inner}\s*"


def _learn(promised: str, printed: str, names: Names) -> None:
    found = re.fullmatch(_pattern(names.in_run(promised)), printed)
    kinds = [kind for kind, _ in _pieces(promised) if kind in ("name", "date", "figure")]
    texts = [text for kind, text in _pieces(promised) if kind in ("name", "date", "figure")]
    for kind, text, other in zip(kinds, texts, found.groups() if found else (), strict=bool(found)):
        if kind == "name":
            names.learn(text, other)


def _shortened(promised: str, printed: str, names: Names) -> str:
    """The promised line, elisions and all, with the figures and names that were printed."""
    found = re.fullmatch(_pattern(names.in_run(promised)), printed)
    assert found is not None, "a line with an elision is aligned by its pattern only"
    values = iter(found.groups())
    kinds = ("name", "date", "figure")
    return "".join(next(values) if kind in kinds else text for kind, text in _pieces(promised))


def _pieces(line: str) -> Iterator[tuple[str, str]]:
    """``(kind, text)`` of a line: elision, name, date, figure, gap, and words between them."""
    end = 0
    for found in PIECE.finditer(line):
        if found.start() > end:
            yield "word", line[end : found.start()]
        yield str(found.lastgroup), found[0]
        end = found.end()
    if line[end:]:
        yield "word", line[end:]
