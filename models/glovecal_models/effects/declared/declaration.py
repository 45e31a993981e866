"""How a user declares an effect of his own: a line of text, or the same as a JSON document.

    name = strap; columns = c.strap_n * own, c.strap_n; unit = deg;
    parameter tau s 0.1 5 = 1; range c.strap_n 0 50; control = circularly shifted

Parts are separated by semicolons or line ends. ``name`` and ``columns`` are needed, the rest is not.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, get_args

import numpy as np

from glovecal_models.effects.base.facts import Control, Parameter
from glovecal_models.errors import BadInput
from glovecal_models.expression import FUNCTIONS, Node, check_names, parse_expressions
from glovecal_models.names import check_channel_name, check_identifier, did_you_mean

LONGEST_TEXT = 2000
MOST_PARAMETERS = 2
MOST_COLUMNS = 8
MOST_VALUES = {1: 8, 2: 6}
"""Tried for each parameter, by the number of parameters."""
RESERVED: tuple[str, ...] = ("own", "own_deg", "t")
"""The joint's signal in its standard deviations and in degrees, and the seconds since the take began."""
_UNIT = re.compile(r"[A-Za-z0-9/%^_-]{1,20}\Z")
_KEYS = ("name", "columns", "unit", "parameters", "ranges", "control", "explanation")


@dataclass(frozen=True)
class Declaration:
    """What the user declared, checked as far as it can be without takes."""

    name: str
    columns: tuple[Node, ...]
    columns_text: str
    unit: str = "deg"
    """Of each weight."""
    parameters: tuple[Parameter, ...] = ()
    starts: tuple[float, ...] = ()
    """What the user believes of each parameter: one of the values that are tried."""
    ranges: tuple[tuple[str, float, float], ...] = ()
    """Context column (without ``c.``), lowest and highest value; others keep the range of training."""
    control: Control = "circularly shifted"
    explanation: str = ""

    @property
    def signals(self) -> tuple[str, ...]:
        """Other signals that it reads."""
        taken = {*RESERVED, *(item.name for item in self.parameters)}
        return tuple(name for name in self._names if name not in taken and not name.startswith("c."))

    @property
    def context(self) -> tuple[str, ...]:
        """Context columns that it reads, without ``c.``."""
        return tuple(name[2:] for name in self._names if name.startswith("c."))

    @property
    def _names(self) -> tuple[str, ...]:
        return tuple(dict.fromkeys(name for node in self.columns for name in node.names))

    @classmethod
    def parse(cls, text: str) -> Declaration:
        """Read the line of text. Raises BadInput."""
        if len(text) > LONGEST_TEXT:
            raise BadInput(f"an effect is declared in at most {LONGEST_TEXT} characters, not {len(text)}")
        document: dict[str, Any] = {}
        for part in filter(None, (piece.strip() for piece in re.split(r"[;\n]", text))):
            _read_part(part, document)
        return cls.from_document(document)

    @classmethod
    def from_document(cls, document: Mapping[str, Any]) -> Declaration:
        """Inverse of ``to_document``; also what REST is sent. Raises BadInput."""
        unknown = [key for key in document if key not in _KEYS]
        if unknown:
            raise BadInput(f"effect: unknown part {unknown[0]!r}; {did_you_mean(unknown[0], _KEYS)}")
        for key in ("name", "columns"):
            if not isinstance(document.get(key), str) or not document[key].strip():
                raise BadInput(f"effect: {key} is missing; write {key} = ...")
        name = check_identifier(document["name"], "effect name")
        source = f"effect {name!r}"
        columns = parse_expressions(document["columns"], source=source)
        if len(columns) > MOST_COLUMNS:
            raise BadInput(f"{source}: at most {MOST_COLUMNS} columns, not {len(columns)}")
        parameters, starts = _parameters(document.get("parameters", []), source)
        declared = cls(
            name, columns, document["columns"], _unit(document.get("unit", "deg"), source), parameters,
            starts, _ranges(document.get("ranges", {}), source), _control(document, source),
            str(document.get("explanation", "")).strip(),
        )  # fmt: skip
        _check_time_constants(columns, [item.name for item in parameters], source)
        for column, _, _ in declared.ranges:
            if column not in declared.context:
                raise BadInput(f"{source}: a range is given for c.{column}, which no column reads")
        return declared

    def to_document(self) -> dict[str, Any]:
        """Plain JSON-able data."""
        return {
            "name": self.name,
            "columns": self.columns_text,
            "unit": self.unit,
            "parameters": [
                {"name": item.name, "unit": item.unit, "low": item.low, "high": item.high, "start": start}
                for item, start in zip(self.parameters, self.starts, strict=True)
            ],
            "ranges": {name: [low, high] for name, low, high in self.ranges},
            "control": self.control,
            "explanation": self.explanation,
        }

    def check_signals(self, signals: set[str], context: set[str]) -> None:
        """Raise BadInput unless every name is recorded; the message lists what is."""
        own = [*RESERVED, *(item.name for item in self.parameters)]
        known = [*own, *sorted(signals), *(f"c.{name}" for name in sorted(context))]
        check_names(self.columns, known, source=f"effect {self.name!r}")


def _read_part(part: str, document: dict[str, Any]) -> None:
    words = part.replace("=", " = ").split()
    if words[0] == "parameter" and words[1:2] != ["="]:
        if len(words) not in (5, 7) or (len(words) == 7 and words[5] != "="):
            raise BadInput(f"cannot read {part!r}; write parameter NAME UNIT LOW HIGH = START")
        keys = ("name", "unit", "low", "high")
        item: dict[str, Any] = dict(zip(keys, words[1:5], strict=True))
        if len(words) == 7:
            item["start"] = words[6]
        document.setdefault("parameters", []).append(item)
    elif words[0] == "range" and words[1:2] != ["="]:
        if len(words) != 4 or not words[1].startswith("c."):
            raise BadInput(f"cannot read {part!r}; write range c.NAME LOW HIGH")
        document.setdefault("ranges", {})[words[1][2:]] = words[2:4]
    else:
        key, equals, value = (piece.strip() for piece in part.partition("="))
        if not equals or key not in ("name", "columns", "unit", "control", "explanation"):
            raise BadInput(
                f"cannot read {part!r}; write name = ..., columns = ..., unit = ..., control = ..., "
                "explanation = ..., parameter ... or range ..."
            )
        if key in document:
            raise BadInput(f"effect: {key} is given twice")
        document[key] = value


def _check_time_constants(columns: Sequence[Node], parameters: Sequence[str], source: str) -> None:
    for node in (below for column in columns for below in column.walk() if below.kind == "lowpass"):
        moving = [name for name in node.parts[1].names if name not in parameters]
        if moving or node.parts[1].has_memory:
            raise BadInput(
                f"{source}: the time constant {node.parts[1].text!r} of a low pass may hold numbers and "
                "parameters, nothing that changes with time"
            )


def _parameters(items: Any, source: str) -> tuple[tuple[Parameter, ...], tuple[float, ...]]:
    if not isinstance(items, list) or not all(isinstance(item, Mapping) for item in items):
        raise BadInput(f"{source}: parameters must be a list of name, unit, low, high and start")
    if len(items) > MOST_PARAMETERS:
        raise BadInput(f"{source}: at most {MOST_PARAMETERS} parameters are searched for, not {len(items)}")
    parameters, starts = [], []
    for item in items:
        name = check_channel_name(str(item.get("name", "")), f"{source}: parameter")
        if name in RESERVED or name in FUNCTIONS or name in [known.name for known in parameters]:
            raise BadInput(f"{source}: a parameter cannot be called {name!r}; that name is taken")
        low, high = (
            _number(item.get(key), f"{source}: {key} of parameter {name}") for key in ("low", "high")
        )
        middle = (low * high) ** 0.5 if low > 0 else (low + high) / 2.0
        start = _number(item.get("start", middle), f"{source}: start of parameter {name}")
        if not low < high or not low <= start <= high:
            raise BadInput(f"{source}: parameter {name} needs low < high and a start between, "
                           f"not {low:g}, {high:g} and {start:g}")  # fmt: skip
        unit = _unit(item.get("unit", "1"), source)
        tried = _tried(low, high, start, MOST_VALUES[len(items)])
        parameters.append(Parameter(name, unit, low, high, f"about {start:g} {unit}, as declared", tried))
        starts.append(start)
    return tuple(parameters), tuple(starts)


def _tried(low: float, high: float, start: float, most: int) -> tuple[float, ...]:
    """Values in a ratio (or, from 0 or below, in even steps), one of them moved to ``start``."""
    values = np.geomspace(low, high, most) if low > 0 else np.linspace(low, high, most)
    values[int(np.argmin(np.abs(values - start)))] = start
    return tuple(values.tolist())


def _ranges(items: Any, source: str) -> tuple[tuple[str, float, float], ...]:
    if not isinstance(items, Mapping):
        raise BadInput(f"{source}: ranges must map context columns to their lowest and highest value")
    result = []
    for column, pair in items.items():
        name = check_channel_name(str(column).removeprefix("c."), f"{source}: range")
        if not isinstance(pair, list | tuple) or len(pair) != 2:
            raise BadInput(f"{source}: the range of c.{name} must be two numbers, not {pair!r}")
        low, high = (_number(value, f"{source}: range of c.{name}") for value in pair)
        if not low < high:
            raise BadInput(f"{source}: the range of c.{name} must rise, not {low:g} to {high:g}")
        result.append((name, low, high))
    return tuple(result)


def _number(value: Any, what: str) -> float:
    try:
        number = float(value)
    except (TypeError, ValueError):
        raise BadInput(f"{what} must be a number, not {value!r}") from None
    if not abs(number) < float("inf"):
        raise BadInput(f"{what} must be a finite number, not {value!r}")
    return number


def _unit(value: Any, source: str) -> str:
    if not isinstance(value, str) or not _UNIT.match(value):
        raise BadInput(f"{source}: a unit is a short word such as deg, s or deg/N, not {value!r}")
    return value


def _control(document: Mapping[str, Any], source: str) -> Control:
    value = document.get("control", "circularly shifted")
    for known in get_args(Control):
        if value == known and known != "none":
            return known
    allowed = ", ".join(item for item in get_args(Control) if item != "none")
    raise BadInput(f"{source}: no control {value!r}; there are {allowed}")
