"""A hand on a page that can be turned: live poses, what to do beside them, or two hands that are compared."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Literal

from nicegui.element import Element

# Registers three.js under the name that our module imports it by.
from nicegui.elements.scene import scene as _scene  # noqa: F401
from nicegui.events import GenericEventArguments

Side = Literal["back", "palm", "side", "corner"]
Hand = Mapping[str, float]
"""Degrees by rotation."""


class HandView(Element, component="hand_view.js", esm={"glovecal-hand": "esm"}):
    """Shows live poses of ``feed``, the address of a live feed; without one, what a ``Replay`` plays."""

    def __init__(
        self,
        skeleton: Mapping[str, Any],
        *,
        label: str,
        feed: str = "",
        empty: str,
        seen_from: Side = "back",
    ) -> None:
        """``skeleton``: as ``GET /v1/subjects/{name}/skeleton`` gives it; ``label``: for screen readers;
        ``seen_from``: at first."""
        super().__init__()
        self._props["skeleton"] = skeleton
        self._props["feed"] = feed
        self._props["label"] = label
        self._props["empty"] = empty
        self._props["from"] = seen_from
        self._props["ghost"] = []
        self._props["raw"] = None
        self._props["calibrated"] = True

    def ghost(self, hands: Sequence[Hand]) -> None:
        """Show a second hand: it takes this pose, or goes to and fro between two; none hides it."""
        self._props["ghost"] = [dict(hand) for hand in hands]
        self.update()

    def raw(self, reads: Mapping[str, str], *, least: float, shown: bool) -> None:
        """Another hand beside the live one, not calibrated: each rotation linear in the sensor it ``reads``,
        from its least to its greatest reading so far; ``least``: counts a sensor has to have moved."""
        self._props["raw"] = {"reads": dict(reads), "least": least, "shown": shown}
        self.update()

    def calibrated(self, shown: bool) -> None:
        """Show or hide the live hand."""
        self._props["calibrated"] = shown
        self.update()

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
