"""Limits that decide what a user is told: each with its unit, its meaning, and what fixed its value.

Each stage has one frozen set of them, in the ``limits.py`` of its folder. ``docs/thresholds.md`` is made from
these sets; ``with_limits`` makes another set, to run a study with.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import Field, dataclass, field, fields, replace
from typing import Any, TypeVar, cast

from glovecal_models.errors import BadInput
from glovecal_models.names import did_you_mean

_KEY = "limit"
Number = TypeVar("Number", int, float)
Limits = TypeVar("Limits")


@dataclass(frozen=True)
class About:
    """What is known of one limit."""

    unit: str
    """"" for a plain number."""
    meaning: str
    fixed_by: str
    """The study, recordings or reason that fixed the value."""


def limit(default: Number, unit: str, meaning: str, fixed_by: str) -> Number:
    """A field of a frozen dataclass of limits."""
    return cast(Number, field(default=default, metadata={_KEY: About(unit, meaning, fixed_by)}))


def described_limits(limits: type[Any]) -> dict[str, tuple[Any, About]]:
    """Default and description of each limit of a set, by name; inherited ones first."""
    return {item.name: (item.default, item.metadata[_KEY]) for item in _limits_in(limits)}


def with_limits(limits: Limits, values: Mapping[str, Any]) -> Limits:
    """The set with other values, by name. Raises BadInput for an unknown name, or a value of another kind."""
    known = {item.name: item for item in _limits_in(type(limits))}
    for name, value in values.items():
        if name not in known:
            raise BadInput(f"there is no limit {name!r}; {did_you_mean(name, sorted(known))}")
        if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
            raise BadInput(f"limit {name} has to be a number, not {value!r}")
        if isinstance(known[name].default, int) and not isinstance(value, int):
            raise BadInput(f"limit {name} has to be a whole number, not {value!r}")
    return replace(cast(Any, limits), **values)


def _limits_in(limits: type[Any]) -> list[Field[Any]]:
    return [item for item in fields(limits) if _KEY in item.metadata]
