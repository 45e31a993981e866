"""The charts: each is a picture of one answer of the service, named for screen readers."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Sequence
from dataclasses import asdict
from typing import Any

from nicegui.element import Element

# Registers ECharts under the name that our modules import it by.
from nicegui.elements.echart import echart as _echart  # noqa: F401

from glovecal_models.comparison.series.answer import ResidualColumn, Series
from glovecal_models.improvement.fall.answer import FallStep, FloorBand
from glovecal_models.takes.answer import TakeSeries
from glovecal_service.plain import document_of
from glovecal_service.rest.effect.answer import EffectPictureView


class Chart(Element, esm={"glovecal-charts": "esm"}):
    """Empty until it is given an answer."""

    def __init__(self, *, label: str) -> None:
        """``label``: for screen readers."""
        super().__init__()
        self._props.update(label=label, document=None)

    def _draw(self, document: dict[str, Any]) -> None:
        self._props.update(document=document)
        self.update()


class ColumnChart(Chart, component="column_chart.js"):
    """Frames, means of bins, and the range of a mean by chance."""

    def show(self, answer: ResidualColumn) -> None:
        self._draw(asdict(answer))


class EffectChart(Chart, component="effect_chart.js"):
    """A model's error over what shows the effect, and what a model with the effect leaves."""

    def show(self, before: EffectPictureView, after: EffectPictureView | None = None) -> None:
        """Of a model without the effect, and of the same
        model with it, on the same takes and rotation."""
        self._draw({"before": document_of(before), "after": None if after is None else document_of(after)})


class TakeChart(Chart, component="take_chart.js"):
    """Readings and reference over time, one band each, zoomed together; and the readings' spectra."""

    def show(self, takes: Sequence[TakeSeries], *, spectra: bool) -> None:
        """One take, or two over each other."""
        self._draw({"takes": [asdict(take) for take in takes], "spectra": spectra})

    def choose(self, from_s: float | None, to_s: float | None) -> None:
        """Mark a stretch as it would be left out; none where an end is missing."""
        self.run_method("choose", from_s, to_s)

    def on_moment(self, chosen: Callable[[float], Any]) -> None:
        """Call with the seconds since the first frame where it was clicked."""

        self.on("moment", lambda event: chosen(float(event.args)))

    def on_stretch(self, chosen: Callable[[float, float], Any]) -> None:
        """Call with the two ends between which a mouse was drawn over it."""

        self.on("stretch", lambda event: chosen(*map(float, event.args)))


class FallChart(Chart, component="fall_chart.js"):
    """One bar a step, with its control's line and the band of the noise floor."""

    def __init__(self, *, label: str) -> None:
        """``label``: for screen readers."""
        super().__init__(label=label)
        self._props.update(pending=None)

    def show(self, steps: Sequence[FallStep], floor: FloorBand | None) -> None:
        """Bars from left to right, and the noise floor where it is known."""
        drawn = [{**vars(step), "label": " ".join(step.label.split())} for step in steps]
        self._draw({"steps": drawn, "floor": floor and dict(vars(floor))})

    def grow(self, label: str, fraction: float) -> None:
        """The place of the next version, and how far the job is that makes it, 0 to 1."""
        pending = {"label": label, "fraction": round(fraction, 3)}
        if pending != self._props["pending"]:
            self._props.update(pending=pending)
            self.update()

    def stand(self) -> None:
        """No further version is being made."""
        if self._props["pending"] is not None:
            self._props.update(pending=None)
            self.update()


class TimeChart(Chart, component="time_chart.js"):
    """One rotation of one or several models."""

    def show(self, models: Sequence[tuple[str, Series]], *, key: str, at_s: float) -> None:
        """``models``: label and series, of the same takes and rotation.

        Cursor A stands at ``at_s`` of linked time at first, B a little later. Zoom and cursors stay where
        they are as long as ``key`` is the same.
        """
        lines = [{"label": label, "series": _rounded(series)} for label, series in models]
        self._draw({"key": key, "at_s": at_s, "rotation": models[0][1].rotation, "models": lines})

    def show_stretch(self, from_s: float, to_s: float) -> None:
        """Zoom to a stretch of linked time, with a cursor at either end."""
        self.run_method("showStretch", from_s, to_s)

    def on_moment(self, chosen: Callable[[str, float], Awaitable[None]]) -> None:
        """Call with the take's id and seconds by its clock where cursor A was put."""

        self.on("moment", lambda event: chosen(str(event.args["take"]), float(event.args["at_s"])))

    def on_window(self, chosen: Callable[[float, float], Awaitable[None]]) -> None:
        """Call with the linked seconds that are shown after zooming and moving."""

        self.on("window", lambda event: chosen(float(event.args["from_s"]), float(event.args["to_s"])))


def worst_moment(series: Series) -> tuple[str, float]:
    """Where the error is largest: the take's id, and seconds by its clock."""
    errors = [
        (abs(error), take.take, time)
        for take in series.takes
        for time, error in zip(take.time_s, take.error_deg, strict=True)
        if error is not None
    ]
    if not errors:
        first = series.takes[0]
        return first.take, first.start_s
    _, take, time = max(errors)
    return take, time


def _rounded(series: Series) -> dict[str, Any]:
    """With as many digits as a picture shows: half as long on its way to the page."""
    takes = []
    for take in series.takes:
        columns = {name: [_digits(one) for one in getattr(take, name)] for name in COLUMNS}
        takes.append({**vars(take), **columns})
    return {**vars(series), "takes": takes}


COLUMNS = ("time_s", "measured_deg", "predicted_deg", "sd_deg", "error_deg")


def _digits(value: float | None) -> float | None:
    return None if value is None else round(value, 4)
