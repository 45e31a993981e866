"""Onto what a take's motion goes: a body at rest, a character of one's own, or a robot's hand."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import partial
from typing import Any

from nicegui import events, ui

from glovecal_service.plain import read
from glovecal_service.rest.take.answer import CharacterHand, MotionFormat
from glovecal_service.studio.file_button import FileButton
from glovecal_service.studio.heading import act
from glovecal_service.studio.service import refusals
from glovecal_service.studio.studio import Studio
from glovecal_service.studio.table import row_head, table


class TakeOnto:
    """Build it inside the part of the page where it belongs; ``show`` it for a format."""

    def __init__(
        self,
        studio: Studio,
        formats: Iterable[MotionFormat],
        motion: Callable[[], dict[str, Any]],
        tell: Callable[[str], None],
    ) -> None:
        """``formats``: all that there are; ``motion``: what is asked for, without what this part adds."""
        self._studio, self._motion, self._tell = studio, motion, tell
        self._onto: str | None = None
        """An upload, or a robot's name."""
        self._bones: dict[str, str] = {}
        """Chosen here, by hand and its bone."""
        self._name = ""
        self._format: MotionFormat | None = None
        with ui.element("section").classes("take-character").props('aria-label="Character or robot"') as part:
            self._part = part
            self._about = ui.label()
            with ui.row().classes("choices"):
                self._robot = ui.select({}, value=None, label="Robot hand", on_change=self._choose_robot)
                self._robot.classes("choice")
                self._characters = {
                    one.format: self._file_button(f"Choose a character (.{one.format})", f".{one.format}")
                    for one in formats
                    if one.characters
                }
                self._urdf = self._file_button("Choose a robot (.urdf)", ".urdf,.xml")
            self._fit = ui.element("div").classes("take-character-fit")

    @property
    def asked(self) -> dict[str, Any]:
        return {} if self._onto is None else {"onto": self._onto, "bones": self._bones}

    def show(self, format: MotionFormat) -> None:
        """What was chosen for a format of another kind is left out."""
        before, self._format = self._format, format
        self._part.set_visibility(bool(format.robots or format.characters))
        for key, button in self._characters.items():
            button.set_visibility(key == format.format)
        for each in (self._robot, self._urdf):
            each.set_visibility(bool(format.robots))
        self._about.set_text(
            "The joint angles of a robot's hand can be written in place of the person's own: of one that is "
            "known, or of your own by its URDF."
            if format.robots
            else "The motion moves a body at rest, or a character of your own: a binary file of the same "
            "format whose hands have bones with common names."
        )
        robots = {name: name.capitalize() for name in format.robots}
        self._robot.set_options({"": "none"} | robots, value="")
        if before is not None and _kind(before) != _kind(format):
            self._leave_out("")

    def _file_button(self, text: str, suffixes: str) -> ui.button:
        made = FileButton(
            text, suffixes=suffixes, largest=self._studio.largest_file, take=self._take_file, tell=self._tell
        )
        return made.button.props("outline no-caps").classes("studio-target")

    async def _take_file(self, name: str, content: bytes) -> None:
        self._tell(f"{name} is being looked at.")
        with refusals(self._tell):
            kept = await self._studio.service.post_file("/uploads", content, "application/octet-stream")
            await self._look(kept["sha256"], name)

    async def _choose_robot(self, event: events.ValueChangeEventArguments) -> None:
        if event.value:
            await self._look(event.value, f"{event.value.capitalize()}'s hand")
        elif self._onto is not None and len(self._onto) < 64:
            self._leave_out("The angles are the person's own.")

    async def _look(self, onto: str, name: str) -> None:
        """How well it shows this take; it is what moves from then on."""
        self._onto, self._name, self._bones = onto, name, {}
        await self._look_again()

    async def _look_again(self) -> None:
        self._fit.clear()
        with refusals(self._refused):
            answer = await self._studio.service.post("/motion/character", self._motion() | self.asked)
            self._tell(f"{self._name} will move.")
            with self._fit:
                for hand in read(list[CharacterHand], answer):
                    self._show_fit(hand)
                with ui.element("div").classes("page-acts"):
                    if self._bones:
                        act("Bones as they were found", self._undo)
                    act("Leave it out", partial(self._leave_out, "Nothing else moves."))

    def _refused(self, sentence: str) -> None:
        """What cannot be shown is not written; bones that were chosen can be taken back."""
        self._tell(sentence)
        if self._bones:
            with self._fit:
                act("Bones as they were found", self._undo)
        else:
            self._onto = None

    async def _undo(self) -> None:
        self._bones = {}
        await self._look_again()

    def _leave_out(self, sentence: str) -> None:
        self._onto, self._bones = None, {}
        self._fit.clear()
        self._robot.set_value("")
        self._tell(sentence)

    def _show_fit(self, hand: CharacterHand) -> None:
        touches = f"{hand.lost} of {hand.touches} touches are lost" if hand.touches else "nothing touches"
        ui.label(
            f"{hand.hand.capitalize()} hand: its fingertips are {hand.fingertip_mm:.1f} mm from the hand's, "
            f"in the hand's size (root mean square over frames and fingers); {touches}."
        )
        if hand.missing:
            lacks = ", ".join(name.replace("_", " ") for name in hand.missing)
            ui.label(f"It has no {lacks}; choose below what is meant, if it has.")
        with ui.element("div").classes("take-character-hand"):
            ui.html(hand.picture, sanitize=False)  # drawn by the service, with words of its own only
            with table(f"Which bone is which, {hand.hand} hand", ("Hand", "Moves")):
                for own in [*hand.bones, *hand.missing]:
                    self._bone_row(hand, own)

    def _bone_row(self, hand: CharacterHand, own: str) -> None:
        chosen = hand.bones.get(own, "")
        with ui.element("tr"):
            row_head(own.replace("_", " "))
            with ui.element("td"):
                if not hand.choices:
                    ui.label(chosen)
                    return
                names = dict.fromkeys([*hand.choices, *([chosen] if chosen else [])])
                field = ui.select(
                    {"": "none"} | {name: name for name in names}, value=chosen, with_input=True,
                    on_change=partial(self._choose_bone, f"{hand.hand}.{own}"),
                ).props("dense options-dense")  # fmt: skip
                field.props["aria-label"] = f"{own.replace('_', ' ')}, {hand.hand}"

    async def _choose_bone(self, key: str, event: events.ValueChangeEventArguments) -> None:
        self._bones[key] = event.value or ""
        await self._look_again()


def _kind(format: MotionFormat) -> str:
    """What can be chosen for it."""
    return format.format if format.characters else "robot" if format.robots else ""
