"""A calibration of another program that was dropped: what it says, and one button that imports it."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from typing import Any

from nicegui import ui

from glovecal_service.rest.model.answer import CalibrationPreview, ImportedCalibration
from glovecal_service.studio.chosen import Chosen
from glovecal_service.studio.drop import Uploaded
from glovecal_service.studio.heading import heading, main_act
from glovecal_service.studio.pages.dropped_tables import USUAL_NAME
from glovecal_service.studio.pages.left_out import tell_left_out
from glovecal_service.studio.service import refusals, warn_long
from glovecal_service.studio.studio import Studio
from glovecal_service.studio.table import table, text_row


class DroppedCalibration:
    """Lines of sensors, the model that they would become, and whose."""

    def __init__(
        self, studio: Studio, file: Uploaded, imported: Callable[[str, Uploaded], Awaitable[None]]
    ) -> None:
        """``imported`` is awaited with the subject and the file."""
        self._studio = studio
        self._file = file
        self._imported = imported

    async def build(self, about: Chosen) -> None:
        """Raises Refusal where the file cannot be read; then nothing is shown."""
        whose = USUAL_NAME if about.is_simulated else about.person or USUAL_NAME
        seen = await self._preview(subject=whose)
        self._place = ui.element("section").classes("finding finding-named")
        self._place.props["aria-label"] = f"Preview of {self._file[1]}"
        with self._place:
            heading(2, self._file[1])
            self._sentence = ui.label("").classes("finding-sentence").props('role="status"')
            with ui.row().classes("choices"):
                self._subject = ui.input(
                    "Whose calibration", value=whose, autocomplete=list(about.people.names)
                )
                self._layout = ui.select(seen.layouts, value=seen.layout, label="Glove")
                self._hand = ui.select(["right", "left"], value=seen.hand, label="Hand")
                main_act("Import the calibration", self._import)
            self._lines = ui.element("div")
        self._show(seen)
        self._subject.on("blur", self._look_again)
        for field in (self._layout, self._hand):
            field.on_value_change(self._look_again)

    async def _preview(self, **more: Any) -> CalibrationPreview:
        body = {"upload": self._file[0]} | more
        return await self._studio.service.ask(CalibrationPreview, "/models/calibrations/preview", body)

    def _chosen(self) -> dict[str, Any]:
        return {
            "subject": self._subject.value, "layout": self._layout.value, "hand": self._hand.value
        }  # fmt: skip

    async def _look_again(self) -> None:
        with refusals():
            self._show(await self._preview(**self._chosen()))

    def _show(self, seen: CalibrationPreview) -> None:
        self._sentence.set_text(seen.sentence)
        self._lines.clear()
        with self._lines:
            tell_left_out(seen.left_out)
            for sensor, miss in seen.misses.items():
                ui.label(f"{sensor}: {miss}.").classes("take-warning")
            with (
                ui.expansion("Rotations: gain and zero of each"),
                table(f"Lines of {self._file[1]}", ("Rotation", "Sensor", "Degrees a count", "0° at")),
            ):
                for line in seen.rotations:
                    text_row(line.rotation, line.sensor, f"{line.gain_deg:.4f}", f"{line.zero:.1f} counts")

    async def _import(self) -> None:
        body = {"upload": self._file[0], "create_subject": True} | self._chosen()
        with refusals(warn_long):
            imported = await self._studio.service.ask(ImportedCalibration, "/models/calibrations", body)
            self._place.clear()
            with self._place:
                here = "was imported" if imported.is_new else "was here already"
                heading(2, f"Model {imported.model.short} of {imported.model.subject} {here}")
                ui.label("It is not active, and its error is not known.")
                ui.link("See it among the models", f"/models?who={imported.model.subject}").classes(
                    "studio-link"
                )
            await self._imported(imported.model.subject, self._file)
