"""Measured, predicted and error over linked time, with cursors."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Mapping, Sequence
from typing import Any

from nicegui.events import GenericEventArguments

from glovecal_service.studio.charts.chart import Chart


class TimeChart(Chart, component="time_chart.js"):
    """One rotation of one or several models."""

    def show(self, models: Sequence[tuple[str, Mapping[str, Any]]], *, key: str, at_s: float) -> None:
        """``models``: label and answer of ``POST /v1/models/{id}/series``, of the same takes and rotation.

        Cursor A stands at ``at_s`` of linked time at first, B a little later. Zoom and cursors stay where
        they are as long as ``key`` is the same.
        """
        lines = [{"label": label, "series": _rounded(series)} for label, series in models]
        self._draw({"key": key, "at_s": at_s, "rotation": models[0][1]["rotation"], "models": lines})

    def show_stretch(self, from_s: float, to_s: float) -> None:
        """Zoom to a stretch of linked time, with a cursor at either end."""
        self.run_method("showStretch", from_s, to_s)

    def on_moment(self, chosen: Callable[[str, float], Awaitable[None]]) -> None:
        """Call with the take's id and seconds by its clock where cursor A was put."""

        async def told(event: GenericEventArguments) -> None:
            await chosen(str(event.args["take"]), float(event.args["at_s"]))

        self.on("moment", told)

    def on_window(self, chosen: Callable[[float, float], Awaitable[None]]) -> None:
        """Call with the linked seconds that are shown after zooming and moving."""

        async def told(event: GenericEventArguments) -> None:
            await chosen(float(event.args["from_s"]), float(event.args["to_s"]))

        self.on("window", told)


def worst_moment(series: Mapping[str, Any]) -> tuple[str, float]:
    """Where the error is largest: the take's id, and seconds by its clock."""
    errors = [
        (abs(error), take["take"], time)
        for take in series["takes"]
        for time, error in zip(take["time_s"], take["error_deg"], strict=True)
        if error is not None
    ]
    if not errors:
        first = series["takes"][0]
        return first["take"], first["start_s"]
    _, take, time = max(errors)
    return take, time


def _rounded(series: Mapping[str, Any]) -> dict[str, Any]:
    """With as many digits as a picture shows: half as long on its way to the page."""
    takes = []
    for take in series["takes"]:
        columns = {name: [_digits(one) for one in take[name]] for name in COLUMNS}
        takes.append({**take, **columns})
    return {**series, "takes": takes}


COLUMNS = ("time_s", "measured_deg", "predicted_deg", "sd_deg", "error_deg")


def _digits(value: float | None) -> float | None:
    return None if value is None else round(value, 4)
