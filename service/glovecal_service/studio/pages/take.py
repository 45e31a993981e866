"""One take: what was recorded, before anything else is made of it; another one over it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any
from urllib.parse import quote

from nicegui import ui

from glovecal_models.presentation.document import counted
from glovecal_models.takes.answer import TakeSeries
from glovecal_service.rest.take.answer import CheckView, Take
from glovecal_service.studio.charts.chart import TakeChart
from glovecal_service.studio.heading import heading
from glovecal_service.studio.service import refusals
from glovecal_service.studio.shell import page, shell
from glovecal_service.studio.studio import Studio

POINTS = 4000
VIEWS = {"time": "Over time", "spectra": "Spectra of the readings"}
KEYS = (
    "Readings are in counts, the reference in degrees, time in seconds since the first frame. Drag below the "
    "curves to zoom, or turn the wheel with Ctrl. Grey: recorded before the take was asked for. Amber: "
    "frames are missing. Over an angle: the reference jumps while the sensors do not."
)


def add(studio: Studio) -> None:
    """``/studio/take``."""

    @page("/take")
    async def take(id: str = "", beside: str = "") -> None:
        async with shell(studio, "takes", "Take") as around:
            ui.add_head_html('<link rel="stylesheet" href="/studio/static/findings.css">')
            await TakePage(studio).build(await around.chosen.takes(studio.service), id, beside)


class TakePage:
    """One open page."""

    def __init__(self, studio: Studio) -> None:
        self._studio = studio
        self._shown: list[TakeSeries] = []

    async def build(self, takes: Sequence[Take], id: str, beside: str) -> None:
        own = next((take for take in takes if id and take.id.startswith(id)), None)
        if own is None:
            ui.label(f"There is no take {id[:12]}." if id else "No take was chosen.").classes("studio-notice")
            ui.link("All takes", "/takes").classes("studio-link")
            return
        alike = [take for take in takes if take.sensors == own.sensors]
        options = {take.id: take.line for take in reversed(alike)}
        self._own = own
        heading(2, f"{own.subject}: {own.line}")
        with ui.row().classes("choices"):
            ui.select(options, value=own.id, label="Take", on_change=self._go).classes("choice")
            others = {"": "none"} | {key: text for key, text in options.items() if key != own.id}
            self._beside = ui.select(
                others, value=beside if beside in others else "", label="Over it", on_change=self._show
            ).classes("choice")
            self._view = ui.toggle(VIEWS, value="time", on_change=self._show).props(
                "no-caps unelevated toggle-color=indigo-8"
            )
        self._told = ui.element("div").props('aria-live="polite"')
        self._chart = TakeChart(label=f"Readings and reference of take {own.name}")
        ui.label(KEYS)
        with ui.element("div").classes("page-acts"):
            ui.link("Export as a table", f"../v1/takes/{own.id}/export").classes("studio-link").props(
                "download"
            )
            ui.link("Train on takes", "/takes").classes("studio-link")
        await self._check()
        await self._show()

    async def _go(self, event: Any) -> None:
        ui.navigate.to(f"/take?id={quote(event.value)}")

    async def _check(self) -> None:
        own = self._own
        rate_hz, gaps, sentences = None, 0, []
        with refusals(sentences.append):
            found = await self._studio.service.read(CheckView, f"/takes/{own.id}/check")
            rate_hz, gaps, sentences = found.rate_hz, found.gaps, found.sentences
        rate = "" if rate_hz is None else f" at {rate_hz:.1f} Hz"
        measured = counted(len(own.rotations), "rotation") if own.rotations else "nothing"
        with self._told:
            ui.label(
                f"{own.frames} frames{rate}, {counted(gaps, 'gap')}; {measured} measured"
                + (", simulated." if own.simulated else ".")
            ).classes("finding-sentence")
            for sentence in sentences:
                ui.label(sentence).classes("take-warning")
            if not sentences:
                ui.label("Nothing looks wrong.")

    async def _show(self) -> None:
        service = self._studio.service
        ids = [self._own.id, *filter(None, [self._beside.value])]
        with refusals():
            shown = [await service.read(TakeSeries, f"/takes/{each}/series", points=POINTS) for each in ids]
            self._chart.show(shown, spectra=self._view.value == "spectra")
