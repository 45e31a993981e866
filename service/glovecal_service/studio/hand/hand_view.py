"""A hand on a page that can be turned and shows live poses."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Literal

from nicegui.element import Element

# Registers three.js under the name that our module imports it by.
from nicegui.elements.scene import scene as _scene  # noqa: F401
from nicegui.events import GenericEventArguments

Side = Literal["back", "palm", "side"]


class HandView(Element, component="hand_view.js", esm={"glovecal-hand": "esm"}):
    """Shows live poses of ``feed``, the address of a live feed."""

    def __init__(self, skeleton: Mapping[str, Any], *, label: str, feed: str, empty: str) -> None:
        """``skeleton``: as ``GET /v1/subjects/{name}/skeleton`` gives it; ``label``: for screen readers."""
        super().__init__()
        self._props["skeleton"] = skeleton
        self._props["feed"] = feed
        self._props["label"] = label
        self._props["empty"] = empty

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
