"""A residual against one recorded column."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from glovecal_service.studio.charts.chart import Chart


class ColumnChart(Chart, component="column_chart.js"):
    """Frames, means of bins, and the range of a mean by chance."""

    def show(self, answer: Mapping[str, Any]) -> None:
        """An answer of ``POST /v1/models/{id}/residual``."""
        self._draw(dict(answer))
