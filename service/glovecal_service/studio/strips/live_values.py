"""Angles of one glove, the terms of one of them, and strips of readings, drawn by the page."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from nicegui.element import Element
from nicegui.events import GenericEventArguments


class AngleList(Element, component="angle_list.js"):
    """Angle and standard deviation of each rotation; one can be chosen."""

    def __init__(self, feed: str, *, label: str) -> None:
        """``feed``: address of the live feed that a hand on the same page shows."""
        super().__init__()
        self._props.update(feed=feed, label=label)

    def on_rotation(self, chosen: Callable[[str | None], Any]) -> None:
        """Call with the rotation that is chosen now, None when it is let go."""

        def told(event: GenericEventArguments) -> Any:
            return chosen(None if event.args is None else str(event.args))

        self.on("rotation", told)

    def highlight(self, rotation: str | None) -> None:
        """It was chosen elsewhere."""
        self.run_method("mark", rotation)


class LiveTerms(Element, component="live_terms.js"):
    """What one angle is made of now."""

    def __init__(self, *, label: str) -> None:
        super().__init__()
        self._props.update(label=label)

    def begin(self, rotation: str | None) -> None:
        """With another rotation; None ends."""
        self.run_method("begin", rotation)

    def show(self, answer: Mapping[str, Any]) -> None:
        """Of one rotation, as a query on ``pose/explain`` answers."""
        self.run_method("show", answer)

    def refuse(self, problem: str) -> None:
        """Why there is nothing to show."""
        self.run_method("refuse", problem)


class SensorStrips(Element, component="sensor_strips.js"):
    """Readings over the last seconds."""

    def __init__(self, feed: str, *, label: str) -> None:
        super().__init__()
        self._props.update(feed=feed, label=label)
