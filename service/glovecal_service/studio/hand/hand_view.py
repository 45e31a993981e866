"""A hand on a page that can be turned, its layers over each other: calibrated, raw and reference."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Literal

from nicegui.element import Element

# Registers three.js under the name that our module imports it by.
from nicegui.elements.scene import scene as _scene  # noqa: F401
from nicegui.events import GenericEventArguments

Layer = Literal["calibrated", "raw", "reference"]
Side = Literal["back", "palm", "side"]


class HandView(Element, component="hand_view.js", esm={"glovecal-hand": "esm"}):
    """Shows live poses of ``feed`` (address of a live feed), or what ``show`` is given."""

    def __init__(
        self, skeleton: Mapping[str, Any] | None, *, label: str, feed: str = "", empty: str = "No pose yet"
    ) -> None:
        """``skeleton``: as ``GET /v1/subjects/{name}/skeleton`` gives it; ``label``: for screen readers."""
        super().__init__()
        self._props["skeleton"] = skeleton
        self._props["feed"] = feed
        self._props["label"] = label
        self._props["empty"] = empty

    def show(
        self, layer: Layer, angles: Mapping[str, float] | None, deviations: Mapping[str, float] | None = None
    ) -> None:
        """Pose a layer: degrees by rotation, and standard deviations; None hides it."""
        self.run_method("show", layer, angles, deviations)

    def look(self, side: Side) -> None:
        self.run_method("look", side)

    def choose(self, rotation: str | None) -> None:
        """Mark the joints of one rotation."""
        self.run_method("choose", rotation)

    def on_rotation(self, chosen: Callable[[str], Any]) -> None:
        """Call with the rotation whose joint was clicked."""

        def told(event: GenericEventArguments) -> Any:
            return chosen(str(event.args))

        self.on("rotation", told)
