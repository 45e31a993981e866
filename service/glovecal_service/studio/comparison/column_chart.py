"""A residual against one recorded column, drawn by the page."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from nicegui.element import Element

# Registers ECharts under the name that our module imports it by.
from nicegui.elements.echart import echart as _echart  # noqa: F401


class ColumnChart(Element, component="column_chart.js", esm={"glovecal-comparison": "esm"}):
    """Frames, means of bins, and the range of a mean by chance; empty until ``show``."""

    def __init__(self, *, label: str) -> None:
        """``label``: for screen readers."""
        super().__init__()
        self._props["label"] = label
        self._props["document"] = None

    def show(self, answer: Mapping[str, Any]) -> None:
        """An answer of ``POST /v1/models/{id}/residual``."""
        self._props["document"] = dict(answer)
        self.update()
