"""A figure of the study beside what is demanded of it, and the table of all figures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from intervals import bootstrap, wilson


@dataclass(frozen=True)
class StudyFigure:
    """A share or a mean with its 95 % interval."""

    name: str
    value: float
    low: float
    high: float
    gloves: int
    count: int | None = None
    """Of a share; None for a mean."""
    at_least: float | None = None
    at_most: float | None = None

    @classmethod
    def share(
        cls,
        name: str,
        hits: Sequence[bool],
        *,
        at_least: float | None = None,
        at_most: float | None = None,
    ) -> StudyFigure:
        count, total = int(np.sum(hits)), len(hits)
        low, high = wilson(count, total)
        return cls(name, count / max(total, 1), low, high, total, count, at_least, at_most)

    @classmethod
    def mean(cls, name: str, values: Sequence[float], *, at_most: float | None = None) -> StudyFigure:
        value = float(np.mean(values)) if len(values) else float("nan")
        return cls(name, value, *bootstrap(values), len(values), at_most=at_most)

    @property
    def is_met(self) -> bool | None:
        """Whether the figure itself (not its interval) is as demanded; None when nothing is."""
        if self.at_least is None and self.at_most is None:
            return None
        lowest = -np.inf if self.at_least is None else self.at_least
        highest = np.inf if self.at_most is None else self.at_most
        return bool(lowest <= self.value <= highest)

    def to_document(self) -> dict[str, Any]:
        return asdict(self) | {"is_met": self.is_met}

    @classmethod
    def from_document(cls, document: Mapping[str, Any]) -> StudyFigure:
        return cls(**{key: value for key, value in document.items() if key != "is_met"})

    def row(self) -> str:
        if not self.gloves:
            return f"| {self.name} | no gloves | | {self._demanded()} | |"
        verdict = {True: "yes", False: "**no**", None: ""}[self.is_met]
        return f"| {self.name} | {self._value()} | {self._interval()} | {self._demanded()} | {verdict} |"

    def _value(self) -> str:
        if self.count is None:
            return f"{self.value:.2f} ({self.gloves} gloves)"
        return f"{100 * self.value:.1f} % ({self.count} of {self.gloves})"

    def _interval(self) -> str:
        if self.count is None:
            return f"{self.low:.2f} to {self.high:.2f}"
        return f"{100 * self.low:.1f} to {100 * self.high:.1f} %"

    def _demanded(self) -> str:
        limits = ((">=", self.at_least), ("<=", self.at_most))
        shown = [f"{sign} {self._limit(value)}" for sign, value in limits if value is not None]
        return ", ".join(shown)

    def _limit(self, value: float) -> str:
        return f"{value:g}" if self.count is None else f"{100 * value:g} %"


def table(figures: Sequence[StudyFigure]) -> str:
    """Markdown."""
    head = "| figure | value | 95 % interval | demanded | met |\n|---|---|---|---|---|"
    return "\n".join([head, *(figure.row() for figure in figures)])
