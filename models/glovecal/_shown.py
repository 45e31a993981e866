"""What every result can do: print itself, show itself in a notebook, become a pandas frame."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

from glovecal._table import Table


class Shown(ABC):
    """A result that describes itself once, as a table; ``print`` and notebooks show it."""

    @abstractmethod
    def table(self) -> Table:
        """Columns, whose names end with their unit, rows, and sentences before and after them."""

    def to_frame(self) -> Any:
        """The table as a pandas DataFrame, numbers unrounded. Raises ImportError without pandas."""
        return self.table().to_frame()

    def __str__(self) -> str:
        return self.table().to_text()

    def __repr__(self) -> str:
        return str(self)

    def _repr_html_(self) -> str:
        return self.table().to_html()
