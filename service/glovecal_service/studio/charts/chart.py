"""What every chart of the pages is: a picture of one answer of the service, named for screen readers."""

from __future__ import annotations

from typing import Any

from nicegui.element import Element

# Registers ECharts under the name that our modules import it by.
from nicegui.elements.echart import echart as _echart  # noqa: F401


class Chart(Element, esm={"glovecal-charts": "esm"}):
    """Empty until it is given an answer."""

    def __init__(self, *, label: str) -> None:
        """``label``: for screen readers."""
        super().__init__()
        self._props["label"] = label
        self._props["document"] = None

    def _draw(self, document: dict[str, Any]) -> None:
        self._props["document"] = document
        self.update()
