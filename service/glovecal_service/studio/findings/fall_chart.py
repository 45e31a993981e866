"""The fall of the error, drawn by the page; it grows while the next version is made."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from nicegui.element import Element

# Registers ECharts under the name that our module imports it by.
from nicegui.elements.echart import echart as _echart  # noqa: F401

# Registers what charts share under the name that our module imports it by.
from glovecal_service.studio.comparison import column_chart as _column_chart  # noqa: F401


class FallChart(Element, component="fall_chart.js"):
    """Empty until ``show``."""

    def __init__(self, *, label: str) -> None:
        """``label``: for screen readers."""
        super().__init__()
        self._props["label"] = label
        self._props["document"] = None
        self._props["pending"] = None

    def show(self, fall: Mapping[str, Any]) -> None:
        """An answer of ``GET /v1/models/{id}/fall``."""
        self._props["document"] = dict(fall)
        self.update()

    def grow(self, label: str, fraction: float) -> None:
        """The place of the next version, and how far the job is that makes it, 0 to 1."""
        pending = {"label": label, "fraction": round(fraction, 3)}
        if pending != self._props["pending"]:
            self._props["pending"] = pending
            self.update()

    def stand(self) -> None:
        """No further version is being made."""
        if self._props["pending"] is not None:
            self._props["pending"] = None
            self.update()
