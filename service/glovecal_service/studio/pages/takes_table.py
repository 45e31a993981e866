"""Takes with their quality: how regular, how complete, what was measured, what looks wrong."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import datetime
from functools import partial
from typing import Any
from urllib.parse import quote

from nicegui import ui

from glovecal_service.studio.heading import heading
from glovecal_service.studio.service import Refusal, Service
from glovecal_service.studio.table import cell, row_head, table

SHOWN = 40
"""The newest ones: each is read whole to be judged."""
HEADS = ("Take", "Subject", "Wearing", "Recorded", "Length", "Frames", "Gaps", "Measured", "Quality")
FEW_SENTENCES = 2


class TakesTable:
    """Takes at once, their quality one after another."""

    def __init__(self, service: Service) -> None:
        self._service = service

    async def build(self) -> None:
        takes = await self._service.get("/takes")
        if not takes:
            return
        places = []
        with ui.element("section").classes("tree").props('aria-label="Takes"'):
            heading(2, "Takes")
            if len(takes) > SHOWN:
                ui.label(f"The newest {SHOWN} of {len(takes)}.")
            with table("Takes and their quality", HEADS):
                for take in takes[: -SHOWN - 1 : -1]:
                    with ui.element("tr") as row:
                        row.props["data-take"] = take["id"]
                        row_head(take["name"])
                        cell(take["subject"])
                        cell(take["wearing"] or "–")
                        cell(_moment(take["created_at"]))
                        cell(f"{take['duration_s']:.1f} s")
                        cell(str(take["frames"]))
                        gaps = cell("…")
                        cell(_measured(take))
                        places.append((take, gaps, ui.element("td").classes("take-quality")))
        ui.timer(0.0, partial(self._judge, places), once=True)

    async def _judge(self, places: Sequence[tuple[Mapping[str, Any], Any, ui.element]]) -> None:
        for take, gaps, place in places:
            try:
                found = await self._service.get(f"/takes/{quote(take['id'])}/check")
            except Refusal as refusal:
                found = {"gaps": None, "rate_hz": None, "sentences": [str(refusal)]}
            gaps.set_text("–" if found["gaps"] is None else str(found["gaps"]))
            rate = "" if found["rate_hz"] is None else f"{found['rate_hz']:.1f} Hz"
            with place:
                _quality(rate, found["sentences"])


def _quality(rate: str, sentences: Sequence[str]) -> None:
    word = f"{len(sentences)} to look at" if sentences else "nothing looks wrong"
    ui.label(", ".join(filter(None, (rate, word))))
    for sentence in sentences[:FEW_SENTENCES]:
        ui.label(sentence).classes("take-warning")
    if len(sentences) > FEW_SENTENCES:
        with ui.expansion(f"{len(sentences) - FEW_SENTENCES} more").props("dense"):
            for sentence in sentences[FEW_SENTENCES:]:
                ui.label(sentence).classes("take-warning")


def _measured(take: Mapping[str, Any]) -> str:
    what = f"{len(take['rotations'])} rotations" if take["rotations"] else "nothing"
    return ", ".join([what, *(["simulated"] if take["simulated"] else [])])


def _moment(text: str | None) -> str:
    return "–" if text is None else f"{datetime.fromisoformat(text).astimezone():%Y-%m-%d %H:%M}"
