"""A take as a file for other tools: format, what of it, one hand or both."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

from nicegui import ui

from glovecal_service.rest.take.answer import MotionFormat, Take
from glovecal_service.studio.heading import heading, main_act
from glovecal_service.studio.pages.take_onto import TakeOnto
from glovecal_service.studio.studio import Studio

CONTENTS = {"joints": "Places of joints", "angles": "Angles of joints", "raw": "Readings as they came"}
LIMIT_S = 1800
NEEDS_ANGLES = "This format needs angles: train a model on this person's takes first."
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
            self._offline = ui.checkbox("The model's angles with both directions of time, not as live")
            self._offline.set_visibility(self._model is not None)
            self._about = ui.label()
            self._onto = TakeOnto(self._studio, formats, self._body, self._tell)
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
        self._onto.show(chosen)
        self._content.set_visibility("raw" in chosen.contents)  # others hold bones, which are both
        self._about.set_text(
            f"In {chosen.unit}; {chosen.axes}. Times: {chosen.times}. Beside the angles: {chosen.accuracy}. "
            f"Read by {chosen.read_by}."
        )
        if not options:
            self._told.set_text(NEEDS_ANGLES)

    def _tell(self, sentence: str) -> None:
        self._told.set_text(sentence)

    def _body(self) -> dict[str, Any]:
        takes = [take for take in (self._own.id, self._other.value) if take]
        measured = self._source.value == "measured"
        is_posed = not measured and self._content.value != "raw"
        return {
            "takes": takes,
            "models": [self._model] if is_posed and len(takes) == 1 else [],
            "content": self._content.value,
            "measured": measured,
            "offline": self._offline.value and is_posed,
            "format": self._format.value,
            "file_name": self._own.name,
            "rate_hz": self._rate.value,
            "low_pass_hz": self._low_pass.value,
        }

    async def _write(self) -> None:
        if self._content.value is None:
            self._told.set_text(NEEDS_ANGLES)
            return
        body = self._body() | self._onto.asked
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
