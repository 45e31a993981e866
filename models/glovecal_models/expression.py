"""Expressions that users write: columns of an effect of their own, and pseudo-sensors of a layout.

    expression = term (("+" | "-") term)*
    term       = factor (("*" | "/") factor)*
    factor     = ("-" | "+") factor | power
    power      = atom ("^" factor)?
    atom       = NUMBER | NAME | "c." NAME | call | "(" expression ")"
    call       = FUNCTION "(" expression ("," expression)* ")"

Functions: exp log sqrt abs tanh sin cos min max clip(x, low, high) lowpass(x, tau_s) previous(x). Nothing is
evaluated. Python's ``ast`` cannot read this: its ``^`` binds less than ``+``, and ``lambda`` is no name.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NoReturn

import numpy as np

from glovecal_models.errors import BadInput, BadLayout
from glovecal_models.names import did_you_mean

LONGEST_TEXT = 500
DEEPEST = 30
MOST_NODES = 200
FUNCTIONS = {
    "exp": 1, "log": 1, "sqrt": 1, "abs": 1, "tanh": 1, "sin": 1, "cos": 1,
    "min": 2, "max": 2, "clip": 3, "lowpass": 2, "previous": 1,
}  # fmt: skip
"""Each function and how many arguments it takes."""
WITH_MEMORY = ("lowpass", "previous")
_TOKEN = re.compile(
    r"\s*(?:(?P<number>(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)|(?P<name>(?:c\.)?[A-Za-z]\w*)|(?P<sign>[-+*/^(),]))",
    re.ASCII,
)


@dataclass(frozen=True)
class Node:
    """A piece of an expression. ``kind`` is "number", "name", "minus", an operator, or a function's name."""

    kind: str
    text: str
    """As the user wrote it, for messages."""
    parts: tuple[Node, ...] = ()
    value: float = 0.0
    """Of a number."""
    place: int = 0
    """Distinguishes the nodes of one effect: each keeps a memory of its own."""

    def walk(self) -> Iterator[Node]:
        """This node and all below."""
        yield self
        for part in self.parts:
            yield from part.walk()

    @property
    def names(self) -> tuple[str, ...]:
        """Every name in it once, context columns with their ``c.``."""
        return tuple(dict.fromkeys(node.text for node in self.walk() if node.kind == "name"))

    @property
    def has_memory(self) -> bool:
        return any(node.kind in WITH_MEMORY for node in self.walk())


def parse_expressions(
    text: str, *, source: str = "expression", functions: Mapping[str, int] = FUNCTIONS
) -> tuple[Node, ...]:
    """Read expressions separated by commas, such as ``c.strap_n * own, c.strap_n``. Raises BadInput."""
    if len(text) > LONGEST_TEXT:
        raise BadInput(f"{source}: an expression has at most {LONGEST_TEXT} characters, this has {len(text)}")
    reader = _Reader(text, source, functions)
    found = [reader.expression(0)]
    while reader.take(","):
        found.append(reader.expression(0))
    if reader.kind != "end":
        reader.fail(f"expected an operator, a comma or the end, not {reader.token!r}")
    return tuple(found)


def check_names(nodes: Collection[Node], known: Collection[str], *, source: str) -> None:
    """Raise BadInput for the first name that is not known, and say which are."""
    for node in nodes:
        for name in node.names:
            if name not in known:
                what = "context column" if name.startswith("c.") else "signal or parameter"
                meant = did_you_mean(name, known, there="known are")
                raise BadInput(f"{source}: no {what} {name!r}; {meant}")


@dataclass(frozen=True)
class SensorExpression:
    """The pseudo-sensor of a 0S1R rotation (Wang & Neff 2013, section 3.3): a weighted sum of sensors.

    ``text`` is what the user wrote, such as ``2/3 * I_PIP``.
    """

    text: str
    terms: tuple[tuple[str, float], ...]

    @property
    def sensors(self) -> tuple[str, ...]:
        return tuple(name for name, _ in self.terms)

    def weights(self, sensors: Sequence[str]) -> np.ndarray:
        """The weight of each of ``sensors``, shape (len(sensors),)."""
        given = dict(self.terms)
        return np.array([given.get(name, 0.0) for name in sensors])

    def __str__(self) -> str:
        return self.text

    @classmethod
    def parse(cls, text: str, *, source: str = "expression") -> SensorExpression:
        """Read ``2/3 * I_PIP`` or ``0.5 * T_TMC + 0.5 * TI_ABD``. Raises BadLayout."""
        try:
            first, *more = parse_expressions(text, source=source, functions={})
        except BadInput as error:
            raise BadLayout(str(error)) from None
        if more:
            raise BadLayout(f"{source}: {text!r} holds a comma; join terms with +")
        terms: dict[str, float] = {}
        for name, weight in _weighted(first, 1.0, f"{source}: {text!r}"):
            terms[name] = terms.get(name, 0.0) + weight
        return cls(text, tuple(terms.items()))


def _weighted(node: Node, factor: float, what: str) -> Iterator[tuple[str, float]]:
    """Sensors and their weights in a weighted sum."""
    if node.kind in ("+", "-"):
        yield from _weighted(node.parts[0], factor, what)
        yield from _weighted(node.parts[1], factor if node.kind == "+" else -factor, what)
        return
    if node.kind == "name":
        yield node.text, factor
        return
    share = node.parts[0] if node.kind == "*" and node.parts[1].kind == "name" else node
    numbers = share.parts if share.kind == "/" else (share,)
    if share is node or any(part.kind != "number" for part in numbers):
        raise BadLayout(f"{what}: cannot read {node.text!r}; write terms such as 2/3 * I_PIP")
    top, bottom = (*(part.value for part in numbers), 1.0)[:2]
    if bottom == 0:
        raise BadLayout(f"{what} divides by zero")
    yield node.parts[1].text, factor * top / bottom


class _Reader:
    """Recursive descent over the text; ``token`` is what comes next."""

    def __init__(self, text: str, source: str, functions: Mapping[str, int]) -> None:
        self._text, self._source, self._functions = text, source, functions
        self._end = self._start = self._last_end = self._nodes = 0
        self.kind, self.token = "", ""
        self._advance()

    def _advance(self) -> None:
        self._last_end = self._end
        rest = self._text[self._end :]
        self._start = self._end + len(rest) - len(rest.lstrip())
        if not rest.strip():
            self.kind, self.token = "end", "the end"
            return
        match = _TOKEN.match(self._text, self._end)
        if match is None:
            self.fail(f"cannot read {self._text[self._start : self._start + 20]!r}")
        self.kind, self._end = str(match.lastgroup), match.end()
        self.token = match[self.kind]

    def fail(self, problem: str) -> NoReturn:
        raise BadInput(f"{self._source}: {problem} at character {self._start + 1} of {self._text!r}")

    def take(self, *signs: str) -> str | None:
        """The sign that comes next, if it is one of these, and go on."""
        if self.kind != "sign" or self.token not in signs:
            return None
        sign = self.token
        self._advance()
        return sign

    def _need(self, sign: str) -> None:
        if not self.take(sign):
            self.fail(f"expected {sign!r}, not {self.token!r}")

    def _node(self, kind: str, start: int, *parts: Node, value: float = 0.0) -> Node:
        self._nodes += 1
        if self._nodes > MOST_NODES:
            raise BadInput(f"{self._source}: an expression has at most {MOST_NODES} parts")
        return Node(kind, self._text[start : self._last_end].strip(), parts, value, self._nodes)

    def _deeper(self, depth: int) -> int:
        if depth >= DEEPEST:
            raise BadInput(f"{self._source}: an expression is at most {DEEPEST} levels deep")
        return depth + 1

    def expression(self, depth: int) -> Node:
        return self._chain(self._term, ("+", "-"), self._deeper(depth))

    def _term(self, depth: int) -> Node:
        return self._chain(self._factor, ("*", "/"), depth)

    def _chain(self, part: Callable[[int], Node], signs: tuple[str, ...], depth: int) -> Node:
        start = self._start
        node = part(depth)
        while sign := self.take(*signs):
            right = part(depth)
            node = self._node(sign, start, node, right)
        return node

    def _factor(self, depth: int) -> Node:
        start = self._start
        sign = self.take("-", "+")
        if sign is None:
            return self._power(depth)
        inner = self._factor(self._deeper(depth))
        return self._node("minus", start, inner) if sign == "-" else inner

    def _power(self, depth: int) -> Node:
        start = self._start
        base = self._atom(depth)
        if not self.take("^"):
            return base
        exponent = self._factor(self._deeper(depth))
        return self._node("^", start, base, exponent)

    def _atom(self, depth: int) -> Node:
        start, token, kind = self._start, self.token, self.kind
        if self.take("("):
            inner = self.expression(depth)
            self._need(")")
            return inner
        if kind not in ("number", "name"):
            self.fail(f"expected a number, a name or '(', not {token!r}")
        self._advance()
        if kind == "number":
            value = float(token)
            if value in (float("inf"), float("-inf")):
                raise BadInput(f"{self._source}: {token} is too large a number")
            return self._node("number", start, value=value)
        if token not in self._functions:
            if self.kind == "sign" and self.token == "(":
                raise BadInput(
                    f"{self._source}: no function {token!r}; {did_you_mean(token, self._functions)}"
                )
            return self._node("name", start)
        self._need("(")
        arguments = [self.expression(depth)]
        while self.take(","):
            arguments.append(self.expression(depth))
        self._need(")")
        if len(arguments) != self._functions[token]:
            raise BadInput(
                f"{self._source}: {token} takes {self._functions[token]} arguments, not {len(arguments)}"
            )
        return self._node(token, start, *arguments)
