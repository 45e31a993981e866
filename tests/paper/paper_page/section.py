"""A section of the page: one table or figure of the paper, and what our issue demands of it."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Demand:
    """A figure that must be reached."""

    what: str
    found: float
    at_most: float
    unit: str

    @property
    def is_reached(self) -> bool:
        return self.found <= self.at_most

    def mark(self) -> str:
        """For the row of the table."""
        word = "reached" if self.is_reached else "MISSED"
        return f"{word}: at most {self.at_most:g}"

    def sentence(self) -> str:
        return f"{self.what}: {self.found:.3g} {self.unit}, must be at most {self.at_most:g}."


@dataclass(frozen=True)
class Section:
    parts: tuple[str, ...]
    """HTML."""
    demands: tuple[Demand, ...] = ()
