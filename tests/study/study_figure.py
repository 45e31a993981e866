"""A figure of the study beside what is demanded of it, and the table of all figures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from intervals import bootstrap, wilson


@dataclass(frozen=True)
class StudyFigure:
    """A share, a mean or a quantile with its 95 % interval."""

    name: str
    value: float
    low: float
    high: float
    gloves: int
    count: int | None = None
    """Of a share; None for a mean or a quantile."""
    at_least: float | None = None
    at_most: float | None = None
    reaches: float | None = None
    """Demanded of the interval: its upper end is not below this."""
    fewest: int = 0
    """With fewer gloves the demand is not met, whatever the value."""
    unit: str = "gloves"
    """What was counted."""
    headline: str = ""
    """Its name among the few figures that judge a whole part; empty for details."""

    @classmethod
    def share(cls, name: str, hits: Sequence[bool], **demanded: Any) -> StudyFigure:
        count, total = int(np.sum(hits)), len(hits)
        low, high = wilson(count, total)
        return cls(name, count / max(total, 1), low, high, total, count, **demanded)

    @classmethod
    def mean(cls, name: str, values: Sequence[float], **demanded: Any) -> StudyFigure:
        if not len(values):
            return cls(name, 0.0, 0.0, 0.0, 0, **demanded)
        return cls(name, float(np.mean(values)), *bootstrap(values), len(values), **demanded)

    @classmethod
    def quantile(cls, name: str, values: Sequence[float], share: float, **demanded: Any) -> StudyFigure:
        if not len(values):
            return cls(name, 0.0, 0.0, 0.0, 0, **demanded)
        interval = bootstrap(values, quantile=share)
        return cls(name, float(np.quantile(values, share)), *interval, len(values), **demanded)

    @property
    def is_met(self) -> bool | None:
        """Whether the figure is as demanded; None when nothing is, or gloves are too few to say yes."""
        if (self.at_least, self.at_most, self.reaches) == (None, None, None) or not self.gloves:
            return None
        lowest = -np.inf if self.at_least is None else self.at_least
        highest = np.inf if self.at_most is None else self.at_most
        met = bool(lowest <= self.value <= highest and (self.reaches is None or self.high >= self.reaches))
        return None if met and self.gloves < self.fewest else met

    @property
    def verdict(self) -> str:
        """yes, **no**, too few, or nothing where nothing is demanded."""
        if self.is_met is None:
            return "too few" if self.demanded and self.gloves else ""
        return "yes" if self.is_met else "**no**"

    @property
    def demanded(self) -> str:
        limits = ((">=", self.at_least), ("<=", self.at_most))
        shown = [f"{sign} {self._limit(value)}" for sign, value in limits if value is not None]
        if self.reaches is not None:
            shown.append(f"interval reaches {self._limit(self.reaches)}")
        if shown and self.fewest:
            shown.append(f"of >= {self.fewest}")
        return ", ".join(shown)

    @property
    def measured(self) -> str:
        """Value and count."""
        if not self.gloves:
            return f"no {self.unit}"
        if self.count is None:
            return f"{self.value:.2f} ({self.gloves} {self.unit})"
        return f"{100 * self.value:.1f} % ({self.count} of {self.gloves} {self.unit})"

    @property
    def interval(self) -> str:
        if not self.gloves:
            return ""
        if self.count is None:
            return f"{self.low:.2f} to {self.high:.2f}"
        return f"{100 * self.low:.1f} to {100 * self.high:.1f} %"

    def to_document(self) -> dict[str, Any]:
        numbers = {name: round(float(getattr(self, name)), 5) for name in ("value", "low", "high")}
        return asdict(self) | numbers | {"is_met": self.is_met}

    @classmethod
    def from_document(cls, document: Mapping[str, Any]) -> StudyFigure:
        return cls(**{key: value for key, value in document.items() if key != "is_met"})

    def row(self) -> str:
        return f"| {self.name} | {self.measured} | {self.interval} | {self.demanded} | {self.verdict} |"

    def _limit(self, value: float) -> str:
        return f"{value:g}" if self.count is None else f"{100 * value:g} %"


def table(figures: Sequence[StudyFigure]) -> str:
    """Markdown."""
    head = "| figure | value | 95 % interval | demanded | met |\n|---|---|---|---|---|"
    return "\n".join([head, *(figure.row() for figure in figures)])
