"""What models leave of each rotation: sentences, the table, and the ceiling that is found on demand."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Mapping, Sequence
from typing import Any

from nicegui import ui

from glovecal_service.studio.comparison.error_table import SCALE, error_table
from glovecal_service.studio.job_watch import JobWatch
from glovecal_service.studio.service import Refusal
from glovecal_service.studio.studio import Studio


class RotationErrors:
    """Empty until ``show``. ``choose`` is told of a rotation, ``again`` once a ceiling was found."""

    def __init__(
        self, studio: Studio, choose: Callable[[str], Awaitable[None]], again: Callable[[], Awaitable[None]]
    ) -> None:
        self._service = studio.service
        self._choose, self._again = choose, again
        self._model = ""
        self._body = ui.element("div")
        self._watch = JobWatch(studio, self._ceiling_found)

    def show(self, model: str, comparisons: Sequence[tuple[str, Mapping[str, Any]]], rotation: str) -> None:
        """``model``: the id of the first; ``comparisons``: short name and answer of
        ``POST /v1/models/{id}/compare``; ``rotation``: the chosen one."""
        self._model = model
        _, first = comparisons[0]
        seen = len(first["trained_on"])
        self._body.clear()
        with self._body:
            with ui.element("div").classes("compare-told"):
                for sentence in first["sentences"]:
                    ui.label(sentence)
                if seen:
                    ui.label(
                        f"Trained on {seen} of these takes: there the error is smaller than on takes it "
                        "has not seen."
                    ).classes("compare-warning")
            error_table(comparisons, rotation, self._choose)
            ui.label(SCALE).classes("compare-scale")
            if first["ceiling"] is not None:
                ui.label(first["ceiling"]["sentence"])
                return
            with ui.row().classes("choices"):
                ui.label("Ceiling: not computed for this model yet.")
                find = ui.button("Find the ceiling", on_click=self._find_ceiling)
                find.props("outline no-caps").classes("studio-target")

    async def _find_ceiling(self) -> None:
        try:
            job = await self._service.post(f"/models/{self._model}/ceiling", {})
        except Refusal as refusal:
            ui.notify(str(refusal), type="warning")
            return
        self._watch.follow(job["id"])

    async def _ceiling_found(self, job: Mapping[str, Any]) -> None:
        if job["state"] == "done":
            await self._again()
