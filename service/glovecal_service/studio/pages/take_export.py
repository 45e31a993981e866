"""A take as a file for other tools: format, what of it, one hand or both."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

from nicegui import ui

from glovecal_service.plain import read
from glovecal_service.rest.take.answer import CharacterHand, MotionFormat, Take
from glovecal_service.studio.file_button import FileButton
from glovecal_service.studio.heading import act, heading, main_act
from glovecal_service.studio.service import refusals
from glovecal_service.studio.studio import Studio
from glovecal_service.studio.table import table, text_row

CONTENTS = {"joints": "Places of joints", "angles": "Angles of joints", "raw": "Readings as they came"}
LIMIT_S = 1800
ON_CHARACTERS = "glb"
SAVE = """
const answer = await fetch("../v1/motion", {
  method: "POST", headers: {"Content-Type": "application/json"}, body: JSON.stringify(BODY),
});
if (!answer.ok) return (await answer.json()).detail || "The file was not written.";
const link = document.createElement("a");
link.href = URL.createObjectURL(await answer.blob());
link.download = NAME;
link.click();
setTimeout(() => URL.revokeObjectURL(link.href), 60000);
return "";
"""


class TakeExport:
    """Build it with ``await part.build()``."""

    def __init__(self, studio: Studio, own: Take, takes: Sequence[Take], model: str | None) -> None:
        """``takes``: among them may be the other hand's; ``model``: the id of whose angles are written, None
        where there is none."""
        self._studio = studio
        self._own = own
        self._other_hands = {
            take.id: take.line for take in takes if take.id != own.id and take.known_hand != own.known_hand
        }
        self._model = model
        self._onto: str | None = None
        """The upload of a character."""

    async def build(self) -> None:
        formats = await self._studio.service.read(list[MotionFormat], "/motion")
        self._formats = {one.format: one for one in formats}
        sources = {"measured": "Measured angles"} if self._own.rotations else {}
        if self._model is not None:
            sources = {"model": f"Angles of model {self._model[:8]}"} | sources
        with ui.expansion("Export for animation tools and analysis").classes("take-export") as part:
            part.props('header-class="studio-target"')
            heading(3, "Export the motion")
            with ui.row().classes("choices"):
                self._format = ui.select(
                    {key: f"{one.name} (.{key})" for key, one in self._formats.items()},
                    value="glb" if sources else "trc", label="Format", on_change=self._show,
                ).classes("choice")  # fmt: skip
                self._content = ui.select({}, label="What").classes("choice")
                self._source = ui.select(sources, value=next(iter(sources), None), label="Whose angles")
                self._source.classes("choice").set_visibility(len(sources) > 0)
                others = {"": "none"} | self._other_hands
                self._other = ui.select(others, value="", label="With the other hand's take").classes(
                    "choice"
                )
                self._rate = ui.number("Frames a second", min=1, max=1000, placeholder="as recorded")
                self._low_pass = ui.number("Low-pass filter, Hz", min=0.1, max=450, placeholder="none")
            self._about = ui.label()
            with ui.element("section").classes("take-character").props('aria-label="Character"') as part:
                self._character_part = part
                ui.label(
                    "The motion moves a body at rest, or a character of your own: a binary glTF file whose "
                    "hands have bones with common names."
                )
                FileButton(
                    "Choose a character (.glb)", suffixes=".glb", largest=self._studio.largest_file,
                    take=self._look, tell=self._tell,
                ).button.props("outline no-caps").classes("studio-target")  # fmt: skip
                self._fit = ui.element("div").classes("take-character-fit")
            with ui.element("div").classes("page-acts"):
                main_act("Export the motion", self._write)
                self._busy = ui.spinner()
            self._told = ui.label().props('aria-live="polite"')
        self._busy.set_visibility(False)
        self._show()

    def _show(self) -> None:
        chosen = self._formats[self._format.value]
        able = [key for key in chosen.contents if key == "raw" or self._source.options]
        options = {key: CONTENTS[key] for key in able}
        self._content.set_options(options, value=next(iter(options), None))
        self._character_part.set_visibility(self._format.value == ON_CHARACTERS)
        self._content.set_visibility("raw" in chosen.contents)  # others hold bones, which are both
        self._about.set_text(
            f"In {chosen.unit}; {chosen.axes}. Times: {chosen.times}. Beside the angles: {chosen.accuracy}. "
            f"Read by {chosen.read_by}."
        )
        if not options:
            self._told.set_text("This format needs angles: train a model on this person's takes first.")

    def _tell(self, sentence: str) -> None:
        self._told.set_text(sentence)

    async def _look(self, name: str, content: bytes) -> None:
        """How well a character shows this take; it is what moves from then on."""
        self._fit.clear()
        self._onto = None
        self._tell(f"{name} is being looked at.")
        with refusals(self._tell):
            kept = await self._studio.service.post_file("/uploads", content, "application/octet-stream")
            body = self._body() | {"onto": kept["sha256"]}
            answer = await self._studio.service.post("/motion/character", body)
            self._onto = kept["sha256"]
            self._tell(f"{name} will move.")
            with self._fit:
                for hand in read(list[CharacterHand], answer):
                    _show_fit(hand)
                act("Leave the character out", self._leave_out)

    def _leave_out(self) -> None:
        self._onto = None
        self._fit.clear()
        self._tell("The motion moves a body at rest.")

    def _body(self) -> dict[str, Any]:
        takes = [take for take in (self._own.id, self._other.value) if take]
        measured = self._source.value == "measured"
        posed = not measured and self._content.value != "raw" and len(takes) == 1
        return {
            "takes": takes,
            "models": [self._model] if posed else [],
            "content": self._content.value,
            "measured": measured,
            "format": self._format.value,
            "file_name": self._own.name,
            "rate_hz": self._rate.value,
            "low_pass_hz": self._low_pass.value,
            "onto": self._onto if self._format.value == ON_CHARACTERS else None,
        }

    async def _write(self) -> None:
        if self._content.value is None:
            return
        body = self._body()
        name = f"{self._own.name}.{self._format.value}"
        code = SAVE.replace("BODY", json.dumps(body)).replace("NAME", json.dumps(name))
        self._told.set_text("The file is being written.")
        self._busy.set_visibility(True)
        try:
            problem = await ui.run_javascript(code, timeout=LIMIT_S)
        except TimeoutError:  # the page was left
            return
        self._busy.set_visibility(False)
        self._told.set_text(problem or f"{name} was written: it is among your downloads.")


def _show_fit(hand: CharacterHand) -> None:
    touches = f"{hand.lost} of {hand.touches} touches are lost" if hand.touches else "nothing touches"
    ui.label(
        f"{hand.hand.capitalize()} hand: its fingertips are {hand.fingertip_mm:.1f} mm from the hand's, in "
        f"the hand's size (root mean square over frames and fingers); {touches}."
    )
    with ui.element("div").classes("take-character-hand"):
        ui.html(hand.picture, sanitize=False)  # drawn by the service, with words of its own only
        with table(f"Which bone is which, {hand.hand} hand", ("Hand", "Character")):
            for own, bone in hand.bones.items():
                text_row(own.replace("_", " "), bone)
    if hand.missing:
        lacks = ", ".join(name.replace("_", " ") for name in hand.missing)
        ui.label(f"The character has no {lacks}.")
