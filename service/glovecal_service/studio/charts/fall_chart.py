"""The fall of the error; it grows while the next version is made."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from glovecal_service.studio.charts.chart import Chart


class FallChart(Chart, component="fall_chart.js"):
    """One bar a step, with its control's line and the band of the noise floor."""

    def __init__(self, *, label: str) -> None:
        """``label``: for screen readers."""
        super().__init__(label=label)
        self._props["pending"] = None

    def show(self, fall: Mapping[str, Any]) -> None:
        """An answer of ``GET /v1/models/{id}/fall``."""
        self._draw(dict(fall))

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
