"""A hand on a page that can be turned: live poses, what to do beside them, or two hands that are compared.

A stretch of a take is played on one hand's view or two, or beside the take's video.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, Literal

from nicegui import ui
from nicegui.element import Element

# Registers three.js under the name that our module imports it by.
from nicegui.elements.scene import scene as _scene  # noqa: F401

from glovecal_service.rest.model.answer import ReplayView
from glovecal_service.rest.take.answer import HandBeside, Take, Video
from glovecal_service.studio.heading import act

Side = Literal["back", "palm", "side", "corner"]
SIDES: tuple[Side, ...] = ("back", "palm", "side")
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
        self._props.update({"from": seen_from}, skeleton=skeleton, feed=feed, label=label, empty=empty)
        self._props.update(ghost=[], raw=None, calibrated=True)

    def ghost(self, hands: Sequence[Hand]) -> None:
        """Show a second hand: it takes this pose, or goes to and fro between two; none hides it."""
        self._props.update(ghost=[dict(hand) for hand in hands])
        self.update()

    def raw(self, reads: Mapping[str, str], *, least: float, shown: bool) -> None:
        """Another hand beside the live one, not calibrated: each rotation linear in the sensor it ``reads``,
        from its least to its greatest reading so far; ``least``: counts a sensor has to have moved."""
        self._props.update(raw={"reads": dict(reads), "least": least, "shown": shown})
        self.update()

    def calibrated(self, shown: bool) -> None:
        """Show or hide the live hand."""
        self._props.update(calibrated=shown)
        self.update()

    def look(self, side: Side) -> None:
        self.run_method("look", side)

    def choose(self, rotation: str | None) -> None:
        """Mark the joints of one rotation."""
        self.run_method("choose", rotation)

    def on_rotation(self, chosen: Callable[[str], Any]) -> None:
        """Call with the rotation whose joint was clicked."""

        self.on("rotation", lambda event: chosen(str(event.args)))


def side_buttons(*views: HandView, sides: Sequence[Side] = SIDES) -> None:
    """From where the hands are seen."""
    with ui.row().classes("glove-sides"):
        for side in sides:
            act(side.capitalize(), partial(_look, views, side))


def _look(views: Sequence[HandView], side: Side) -> None:
    for view in views:
        view.look(side)


class Replay(Element, component="replay.js"):
    """Play, pause, a slider over the stretch, and the distance of each finger's tips in mm."""

    def __init__(self, hand: HandView, beside: HandView | None = None) -> None:
        """``beside``: shows another model's prediction of the same frames."""
        super().__init__()
        other = None if beside is None else beside.id
        self._props.update(hand=hand.id, other=other, document=None, beside=None)

    def show(self, answer: ReplayView, *, start_s: float, beside: ReplayView | None = None) -> None:
        """``start_s``: of the take, by its clock; ``beside``:
        the answer of the other hand's model."""
        document = {**dict(answer), "start_s": start_s}
        self._props.update(document=document, beside=None if beside is None else dict(beside))
        self.update()


ROOT = "/v1"


class TakeReplay(Element, component="take_replay.js"):
    """A take's hand over its whole time: play, pause, a slider, the speed, and a cursor in its chart."""

    def __init__(self, hand: HandView, chart: Element, take: Take, model: str | None) -> None:
        """``model``: whose poses are shown where nothing was measured."""
        super().__init__()
        address = f"{ROOT}/takes/{take.id}/hand" + (f"?model={model}" if model else "")
        self._props.update(hand=hand.id, chart=chart.id, address=address, duration=take.duration_s, start=0)

    def seek(self, at_s: float) -> None:
        """Go to a moment, seconds since the take's first frame, and stand there."""
        self.run_method("seek", at_s)

    def on_edge(self, chosen: Callable[[Literal["from", "to"], float], Any]) -> None:
        """Call with the moment at which a stretch is to begin, or to end."""

        self.on("edge", lambda event: chosen(event.args["edge"], float(event.args["at_s"])))


class VideoBeside(Element, component="video_beside.js"):
    """Play, pause, picture by picture, and a slider; nothing before ``show``."""

    def __init__(self, hand: HandView) -> None:
        super().__init__()
        self._props.update(hand=hand.id, root=ROOT, video=None, hands=None)

    def show(self, video: Video | None, hands: HandBeside | None) -> None:
        """A take's video and a model's hand beside it; the moment stays where the video does."""
        self._props.update(video=video and dict(video), hands=hands and dict(hands))
        self.update()
