"""The one picture that shows an effect in a model's error, drawn by the page."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from nicegui.element import Element

# Registers ECharts under the name that our module imports it by.
from nicegui.elements.echart import echart as _echart  # noqa: F401

# Registers what charts share under the name that our module imports it by.
from glovecal_service.studio.comparison import column_chart as _column_chart  # noqa: F401


class EffectChart(Element, component="effect_chart.js"):
    """Empty until ``show``."""

    def __init__(self, *, label: str) -> None:
        """``label``: for screen readers."""
        super().__init__()
        self._props["label"] = label
        self._props["document"] = None

    def show(self, before: Mapping[str, Any], after: Mapping[str, Any] | None = None) -> None:
        """Answers of ``POST /v1/models/{id}/effect-picture``: of a model without the effect, and of the same
        model with it, on the same takes and rotation."""
        self._props["document"] = {"before": dict(before), "after": None if after is None else dict(after)}
        self.update()
