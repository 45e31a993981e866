"""The list of angles and the strips of readings of one glove, drawn by the page from its live feed."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from nicegui.element import Element
from nicegui.events import GenericEventArguments


class AngleList(Element, component="angle_list.js"):
    """Angle and standard deviation of each rotation; one can be chosen."""

    def __init__(self, feed: str, *, label: str) -> None:
        """``feed``: address of the live feed that a hand on the same page shows."""
        super().__init__()
        self._props["feed"] = feed
        self._props["label"] = label

    def on_rotation(self, chosen: Callable[[str | None], Any]) -> None:
        """Call with the rotation that is chosen now, None when it is let go."""

        def told(event: GenericEventArguments) -> Any:
            return chosen(None if event.args is None else str(event.args))

        self.on("rotation", told)


class SensorStrips(Element, component="sensor_strips.js"):
    """Readings over the last seconds."""

    def __init__(self, feed: str, *, label: str) -> None:
        super().__init__()
        self._props["feed"] = feed
        self._props["label"] = label
