"""How large a subject's hand is: a picture of what is measured, and the sizes to be changed."""

from __future__ import annotations

import math
from collections.abc import Mapping
from urllib.parse import quote

from nicegui import ui
from nicegui.elements.mixins.text_element import TextElement
from nicegui.events import ValueChangeEventArguments

from glovecal_service.rest.subject.answer import SkeletonView
from glovecal_service.studio.heading import act, heading
from glovecal_service.studio.person_choice import People
from glovecal_service.studio.service import Service, refusals

THUMB = "T"
THUMB_TURN = math.radians(38.0)
"""So far the thumb is drawn off the hand, to be seen."""
ROOM_MM = 26.0
Point = tuple[float, float]
"""On the page, mm: to the right, downwards."""


class DimensionsForm:
    """One section of a page; nothing without a subject."""

    def __init__(self, service: Service) -> None:
        self._service = service
        self._subject = ""

    async def build(self) -> None:
        people = await People.of(self._service)
        if not people.names:
            return
        self._subject = people.names[0]
        with ui.element("section").classes("tree hand-sizes").props('aria-label="Hand dimensions"'):
            heading(2, "Hand dimensions")
            ui.label(
                "Hands on every page and errors of fingertips are of this size. Models stay as they are."
            )
            people.select("Subject", self._subject, self._choose)
            self._shown = ui.element("div").classes("hand-sizes-pair")
            self._told = ui.label("").props('role="status"')
        await self._show()

    async def _choose(self, event: ValueChangeEventArguments) -> None:
        self._subject = str(event.value)
        self._told.set_text("")
        await self._show()

    async def _show(self) -> None:
        skeleton = await self._service.read(SkeletonView, f"/subjects/{quote(self._subject)}/skeleton")
        sizes, measured = skeleton.dimensions.sizes, skeleton.dimensions.measured
        self._shown.clear()
        with self._shown:
            _picture(skeleton, list(sizes))
            with ui.element("div"):
                fields = {}
                with ui.element("div").classes("hand-fields"):
                    for number, (name, size) in enumerate(sizes.items(), 1):
                        fields[name] = ui.number(
                            f"{number}  {name}, mm", value=round(size, 1) if name in measured else None,
                            placeholder=f"{size:.1f} by scale", min=1, max=400, step=0.1,
                        ).props("stack-label dense")  # fmt: skip
                act("Save", lambda: self._save(skeleton.hand, fields))
                ui.label("Leave empty to estimate it from the hand's length.")

    async def _save(self, hand: str, fields: Mapping[str, ui.number]) -> None:
        sizes = {name: float(field.value) for name, field in fields.items() if field.value}
        with refusals(self._told.set_text):
            await self._service.put(
                f"/subjects/{quote(self._subject)}/hand", {"dimensions": sizes, "hand": hand}
            )
            self._told.set_text("Saved.")
            await self._show()


def _picture(skeleton: SkeletonView, names: list[str]) -> None:
    """The back of the hand; each measure has the number of its field."""
    lines = _lines(skeleton)
    ends = [point for begin, end in lines.values() for point in (begin, end)]
    left, right = min(x for x, _ in ends) - ROOM_MM, max(x for x, _ in ends) + ROOM_MM
    top, bottom = min(y for _, y in ends) - ROOM_MM, max(y for _, y in ends) + ROOM_MM
    with ui.element("svg").classes("hand-picture") as drawing:
        drawing.props["viewBox"] = f"{left:.0f} {top:.0f} {right - left:.0f} {bottom - top:.0f}"
        drawing.props["role"] = "img"
        drawing.props["aria-label"] = "The back of the hand with the measures, numbered as their fields"
        for name, (begin, end) in lines.items():
            line = ui.element("line").classes("hand-measure" if name.startswith("hand_") else "hand-bone")
            for key, value in zip(("x1", "y1", "x2", "y2"), (*begin, *end), strict=True):
                line.props[key] = f"{value:.1f}"
        for name, (begin, end) in lines.items():
            x, y = 0.5 * (begin[0] + end[0]), 0.5 * (begin[1] + end[1])
            dot = ui.element("circle").classes("hand-number")
            label = TextElement(tag="text", text=str(names.index(name) + 1)).classes("hand-number-text")
            for element, keys in ((dot, ("cx", "cy")), (label, ("x", "y"))):
                element.props[keys[0]], element.props[keys[1]] = f"{x:.1f}", f"{y:.1f}"
            dot.props["r"] = "6"


def _lines(skeleton: SkeletonView) -> dict[str, tuple[Point, Point]]:
    """Begin and end of each measure, the fingers straight."""
    joints = {each.name: each for each in skeleton.joints}
    sizes = skeleton.dimensions.sizes
    side = 1.0 if joints["I_ABD"].offset[1] > 0 else -1.0
    lines: dict[str, tuple[Point, Point]] = {}
    for finger in dict.fromkeys(name[0] for name in sizes if not name.startswith("hand_")):
        bones = [name for name in sizes if name.startswith(f"{finger}_")]
        turn = THUMB_TURN if finger == THUMB else 0.0
        first = next(each for each in joints.values() if each.name.startswith(f"{finger}_"))
        root = _on_page(first.offset)
        at = root if finger == THUMB else (0.0, 0.0)
        for bone in bones:
            length = sizes[bone]
            if bone.endswith("metacarpal") and finger != THUMB:
                end = root
            else:
                end = (at[0] - side * length * math.sin(turn), at[1] - length * math.cos(turn))
            lines[bone] = (at, end)
            at = end
    outer = max((abs(x) for begin, end in lines.values() for x in (begin[0], end[0])), default=0.0)
    tip = lines["M_distal"][1][1]
    beside = side * (0.55 * outer + 14.0)
    lines["hand_length"] = ((beside, 0.0), (beside, tip))
    knuckle = lines["I_metacarpal"][1]
    half = 0.5 * sizes["hand_breadth"]
    middle = 0.5 * (knuckle[0] + lines["P_metacarpal"][1][0])
    lines["hand_breadth"] = ((middle - half, knuckle[1] + 24.0), (middle + half, knuckle[1] + 24.0))
    return lines


def _on_page(offset: list[float]) -> Point:
    """x of the hand is upwards, y to the left."""
    return -offset[1], -offset[0]
