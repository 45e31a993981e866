"""What models leave of each rotation: sentences, errors as heat, and the ceiling that is found on demand."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Sequence
from functools import partial
from typing import Any

from nicegui import ui

from glovecal_models.ceiling.answer import PossibleGain
from glovecal_models.comparison.answer import Comparison, NoiseFloor
from glovecal_models.comparison.answer import RotationErrors as Errors
from glovecal_service.rest.job.answer import Job, JobFacts
from glovecal_service.studio.amounts import degrees
from glovecal_service.studio.heading import act
from glovecal_service.studio.job_watch import JobWatch
from glovecal_service.studio.service import refusals
from glovecal_service.studio.studio import Studio
from glovecal_service.studio.table import cell, table

Compared = Sequence[tuple[str, Comparison]]
"""Models by their short names."""
OVERALL = "all rotations"
COOL_TIMES, HOT_TIMES = 1.0, 5.0
"""Times the noise floor at which a cell has no colour, and all of it."""
HOTTEST_PERCENT = 45
"""More of the colour, and the text on it would be hard to read."""

SCALE = (
    "Root mean square error in degrees, predicted against measured. Colour: the error over its noise floor, "
    "from none at the floor to full at five times the floor. Noise floor: how small an error can get on "
    "these takes. Ceiling: the error that a black box on everything recorded leaves. Baseline: the error of "
    "always answering the mean angle."
)


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

    def show(self, model: str, compared: Compared, rotation: str) -> None:
        """``model``: the id of the first; ``rotation``: the chosen one."""
        self._model = model
        _, first = compared[0]
        seen = len(first.trained_on)
        self._body.clear()
        with self._body:
            with ui.element("div").classes("compare-told"):
                for sentence in first.sentences:
                    ui.label(sentence)
                if seen:
                    ui.label(
                        f"Trained on {seen} of these takes: there the error is smaller than on takes it "
                        "has not seen."
                    ).classes("compare-warning")
            _error_table(compared, rotation, self._choose)
            ui.label(SCALE).classes("compare-scale")
            if first.ceiling is not None:
                ui.label(first.ceiling.sentence)
                return
            with ui.row().classes("choices"):
                ui.label("Ceiling: not computed for this model yet.")
                act("Find the ceiling", self._find_ceiling)

    async def _find_ceiling(self) -> None:
        with refusals():
            job = await self._service.ask(JobFacts, f"/models/{self._model}/ceiling")
            self._watch.follow(job.id)

    async def _ceiling_found(self, job: Job) -> None:
        if job.state == "done":
            await self._again()


def _error_table(compared: Compared, chosen: str, choose: Callable[[str], Any]) -> None:
    """The first model's floor, ceiling and baseline stand beside, and its worst rotation first."""
    _, first = compared[0]
    ceiling = {} if first.ceiling is None else first.ceiling.rotations
    overall = None if first.ceiling is None else first.ceiling.overall
    heads = ("Rotation", *(f"Error, {name}" for name, _ in compared), "Noise floor", "Ceiling", "Baseline")
    with table("Error of each rotation", heads, "error-table"):
        _row(OVERALL, [one.overall for _, one in compared], overall, None, choose)
        for name in sorted(first.rotations, key=lambda name: -first.rotations[name].rmse_deg):
            errors = [one.rotations.get(name) for _, one in compared]
            _row(name, errors, ceiling.get(name), chosen == name, choose)
    floors = [one.floor for one in first.rotations.values() if one.floor is not None]
    doubted = [floor for floor in floors if not floor.is_reliable]
    if doubted:
        reasons = dict.fromkeys(reason for floor in doubted for reason in floor.reasons)
        ui.label(
            f"* {len(doubted)} of {len(floors)} noise floors are not reliable: {'; '.join(reasons)}."
        ).classes("compare-scale")


def worst_rotation(comparison: Comparison) -> str:
    """That with the largest error."""
    return max(comparison.rotations, key=lambda name: comparison.rotations[name].rmse_deg)


def _row(
    name: str,
    errors: Sequence[Errors | None],
    ceiling: PossibleGain | None,
    is_chosen: bool | None,
    choose: Callable[[str], Any],
) -> None:
    """``is_chosen`` None: a row that cannot be chosen."""
    with ui.element("tr") as row:
        row.props["data-rotation"] = name
        with ui.element("th").props('scope="row"'):
            if is_chosen is None:
                ui.label(name)
            else:
                button = ui.element("button").classes("rotation-button").props('type="button"')
                button.props["aria-pressed"] = "true" if is_chosen else "false"
                button.on("click", partial(choose, name))
                with button:
                    ui.label(name)
        for one in errors:
            _error_cell(one)
        known = next((one for one in errors if one is not None), None)
        floor = None if known is None else known.floor
        cell(_floor(floor))
        cell("–" if ceiling is None else degrees(ceiling.ceiling_deg))
        cell("–" if known is None else degrees(known.baseline_deg))


def _error_cell(one: Errors | None) -> None:
    if one is None:
        cell("–")
        return
    floor = one.floor
    times = None if floor is None or not floor.floor_deg else one.rmse_deg / floor.floor_deg
    with ui.element("td").classes("error-cell") as heat:
        if times is not None:
            share = min(1.0, max(0.0, (times - COOL_TIMES) / (HOT_TIMES - COOL_TIMES)))
            heat.style(f"--heat: {HOTTEST_PERCENT * share:.0f}%")
        ui.label(degrees(one.rmse_deg)).classes("error-value")
        if times is not None:
            ui.label(f"{times:.1f} × floor").classes("error-times")


def _floor(floor: NoiseFloor | None) -> str:
    if floor is None:
        return "–"
    least = "at least " if floor.is_lower_bound else ""
    return f"{least}{degrees(floor.floor_deg)}{'' if floor.is_reliable else ' *'}"
