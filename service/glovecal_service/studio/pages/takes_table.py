"""Takes with their quality: how regular, how complete, what was measured, what looks wrong."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

from nicegui import ui
from nicegui.elements.mixins.text_element import TextElement

from glovecal_service.rest.take.answer import CheckView, Take
from glovecal_service.studio.amounts import moment
from glovecal_service.studio.heading import heading
from glovecal_service.studio.paged_list import PagedList
from glovecal_service.studio.repeating import soon
from glovecal_service.studio.service import Refusal, Service
from glovecal_service.studio.table import cell, row_head, table

AT_ONCE = 20
"""Each is read whole to be judged."""
HEADS = ("Take", "Subject", "Wearing", "Recorded", "Length", "Frames", "Gaps", "Measured", "Quality")
FEW_SENTENCES = 2


class TakesTable:
    """Takes at once, their quality one after another."""

    def __init__(self, service: Service) -> None:
        self._service = service

    async def build(self) -> None:
        with ui.element("section").classes("tree").props('aria-label="Takes"'):
            heading(2, "Takes")
            await PagedList(self._service, Take, "/takes", self._show, what="takes", at_once=AT_ONCE).build()

    async def _show(self, takes: list[Take]) -> None:
        places = []
        with table("Takes and their quality", HEADS):
            for take in takes:
                with ui.element("tr") as row:
                    row.props["data-take"] = take.id
                    with row_head(""):
                        ui.link(take.name, f"/take?id={take.id}").classes("studio-link")
                        if take.note:
                            ui.label(take.note).classes("row-note")
                    cell(take.subject)
                    cell(take.wearing or "–")
                    cell(moment(take.created_at))
                    cell(f"{take.duration_s:.1f} s" + (", in part left out" if take.left_out else ""))
                    cell(str(take.frames))
                    gaps = cell("…")
                    cell(_measured(take))
                    places.append((take, gaps, ui.element("td").classes("take-quality")))
        soon(partial(self._judge, places))

    async def _judge(self, places: Sequence[tuple[Take, TextElement, ui.element]]) -> None:
        for take, gaps, place in places:
            try:
                found = await self._service.read(CheckView, f"/takes/{take.id}/check")
            except Refusal as refusal:
                gaps.set_text("–")
                with place:
                    _quality("", [str(refusal)])
                continue
            gaps.set_text(str(found.gaps))
            with place:
                _quality("" if found.rate_hz is None else f"{found.rate_hz:.1f} Hz", found.sentences)


def _quality(rate: str, sentences: Sequence[str]) -> None:
    word = f"{len(sentences)} to look at" if sentences else "nothing looks wrong"
    ui.label(", ".join(filter(None, (rate, word))))
    for sentence in sentences[:FEW_SENTENCES]:
        ui.label(sentence).classes("take-warning")
    if len(sentences) > FEW_SENTENCES:
        with ui.expansion(f"{len(sentences) - FEW_SENTENCES} more").props("dense"):
            for sentence in sentences[FEW_SENTENCES:]:
                ui.label(sentence).classes("take-warning")


def _measured(take: Take) -> str:
    what = f"{len(take.rotations)} rotations" if take.rotations else "nothing"
    return ", ".join([what, *(["simulated"] if take.simulated else [])])
