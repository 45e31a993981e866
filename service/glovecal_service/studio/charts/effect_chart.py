"""The one picture that shows an effect in a model's error."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from glovecal_service.studio.charts.chart import Chart


class EffectChart(Chart, component="effect_chart.js"):
    """A model's error over what shows the effect, and what a model with the effect leaves."""

    def show(self, before: Mapping[str, Any], after: Mapping[str, Any] | None = None) -> None:
        """Answers of ``POST /v1/models/{id}/effect-picture``: of a model without the effect, and of the same
        model with it, on the same takes and rotation."""
        self._draw({"before": dict(before), "after": None if after is None else dict(after)})
