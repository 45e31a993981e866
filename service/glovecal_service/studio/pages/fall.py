"""Error fall: from the simplest calibration through each effect to the noise floor; undo the last step."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from nicegui import ui

from glovecal_service.studio.amounts import degrees
from glovecal_service.studio.pages.fall_chart import Bar, fall_chart
from glovecal_service.studio.pages.model_select import model_select
from glovecal_service.studio.service import Refusal
from glovecal_service.studio.shell import shell
from glovecal_service.studio.studio import Studio


def add(studio: Studio) -> None:
    """``/studio/fall``."""

    @ui.page("/fall")
    async def fall(model: str = "") -> None:
        with shell(studio, "fall", "Error fall"):
            await FallPage(studio, model).build()


class FallPage:
    """One open page: the line of descent of one model."""

    def __init__(self, studio: Studio, model: str) -> None:
        self._studio = studio
        self._model = model

    async def build(self) -> None:
        model = await model_select(self._studio.service, self._model, self._choose)
        if model is None:
            return
        self._model = model
        self._shown = ui.element("div").classes("findings")
        await self._show()

    async def _choose(self, model: str) -> None:
        self._model = model
        await self._show()

    async def _show(self) -> None:
        service = self._studio.service
        line = list(reversed(await service.get(f"/models/{self._model}/lineage")))
        others = [
            each
            for each in await service.get("/models", subject=line[0]["subject"], layout=line[0]["layout"])
            if each["parent"] is None and each["method"] != line[0]["method"] and not each["effects"]
        ]
        improvement = await self._improvement(line)
        self._shown.clear()
        with self._shown:
            bars = _bars(line, others, improvement)
            floors = {} if improvement is None else improvement["noise_floor_deg"]
            fall_chart(bars, [value for value in floors.values() if value is not None])
            ui.label(_sentence(bars)).classes("finding-sentence")
            for item in [] if improvement is None else improvement["undone"]:
                ui.label(f"Undone: {item['sentence']}")
            if line[-1]["effects"]:
                effect = line[-1]["effects"][-1]
                ui.button(f"Take {effect} out", on_click=lambda: self._take_out(effect)).props(
                    "outline no-caps"
                ).classes("studio-target")

    async def _improvement(self, line: Sequence[Mapping[str, Any]]) -> Mapping[str, Any] | None:
        """Of the job that made a model of this line; None for one made step by step."""
        ids = {each["id"] for each in line}
        for job in await self._studio.service.get("/jobs"):
            if job["kind"] == "improve" and job["state"] == "done":
                whole = await self._studio.service.get(f"/jobs/{job['id']}")
                if ids & {step["model"] for step in whole["result"]["steps"]}:
                    return whole["result"]
        return None

    async def _take_out(self, effect: str) -> None:
        try:
            await self._studio.service.delete(f"/models/{self._model}/effects/{effect}")
        except Refusal as refusal:
            ui.notify(str(refusal), type="warning")
            return
        ui.notify("A version without it is being made: see Jobs.", position="bottom-right")


def _bars(
    line: Sequence[Mapping[str, Any]],
    others: Sequence[Mapping[str, Any]],
    improvement: Mapping[str, Any] | None,
) -> list[Bar]:
    """Simpler calibrations for scale, then the versions."""
    baselines = {} if improvement is None else improvement["baselines"]
    simpler = {each["method"]: each["held_out_rmse_deg"] for each in others} | baselines
    controls = {
        step["model"]: step["control_rmse_deg"]
        for step in ([] if improvement is None else improvement["steps"])
    }
    scale = [
        Bar(name, error, None, is_scale=True)
        for name, error in sorted(simpler.items(), key=lambda item: -(item[1] or 0.0))
        if error is not None and name != line[0]["method"]
    ]
    versions, known = [], 0
    for each in line:
        new = each["effects"][known:]
        label = "+ " + ", ".join(new) if new else each["method"]
        known = len(each["effects"])
        if each["held_out_rmse_deg"] is not None:
            versions.append(Bar(label, each["held_out_rmse_deg"], controls.get(each["id"]), is_scale=False))
    return [*scale, *versions]


def _sentence(bars: Sequence[Bar]) -> str:
    if not bars:
        return "No error was measured: these models were trained without holding takes out."
    first, last = bars[0], bars[-1]
    return f"Held-out error: {degrees(first.error_deg)} with {first.label}, {degrees(last.error_deg)} now."
