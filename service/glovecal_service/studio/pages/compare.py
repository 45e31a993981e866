"""Compare: models against measurements, where they fail, and what an angle is made of there."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Mapping
from functools import partial
from typing import Any, TypeVar
from urllib.parse import urlencode

from nicegui import ui

from glovecal_models.calibration.answer import Explanation
from glovecal_models.comparison.answer import Comparison
from glovecal_models.comparison.series.answer import Series
from glovecal_models.comparison.where.answer import Stretch, WhereItFails
from glovecal_service.studio.amounts import degrees
from glovecal_service.studio.charts.chart import TimeChart, worst_moment
from glovecal_service.studio.chosen import Chosen
from glovecal_service.studio.comparison.angle_terms import angle_terms
from glovecal_service.studio.comparison.choices import (
    Choice,
    ChoiceBar,
    first_choice,
    measured_takes,
    short_names,
    usual_takes,
)
from glovecal_service.studio.comparison.error_against_column import ErrorAgainstColumn
from glovecal_service.studio.comparison.replayed_hand import ReplayedHand
from glovecal_service.studio.comparison.rotation_errors import RotationErrors, worst_rotation
from glovecal_service.studio.heading import heading
from glovecal_service.studio.hidden_walk import HiddenWalk
from glovecal_service.studio.next_steps import next_steps
from glovecal_service.studio.repeating import soon
from glovecal_service.studio.service import Refusal, refusals
from glovecal_service.studio.shell import page, shell
from glovecal_service.studio.studio import Studio

NOTHING = "There is no model with measured takes to compare."
Found = TypeVar("Found")
POINTS = 4000
"""Of one model; takes of a minute in all are drawn frame by frame."""


def add(studio: Studio) -> None:
    """``/studio/compare``."""

    @page("/compare")
    async def compare(models: str = "", takes: str = "", rotation: str = "", column: str = "") -> None:
        async with shell(studio, "compare", "Compare", about_models=True) as around:
            ui.add_head_html('<link rel="stylesheet" href="/studio/static/compare.css">')
            await ComparePage(studio, rotation, column).build(around.chosen, models, takes)


class ComparePage:
    """One open page. The first model is the one whose stretches, hand and columns are shown."""

    def __init__(self, studio: Studio, rotation: str, column: str) -> None:
        self._service = studio.service
        self._studio = studio
        self._rotation = rotation
        self._column = column
        self._comparisons: list[Comparison] = []
        self._series: list[Series] = []
        self._client = ui.context.client
        self._moment = ("", 0.0)
        """Where cursor A is: a take's id, and seconds by its clock."""

    async def build(self, about: Chosen, wanted: str, on: str) -> None:
        models = list(reversed(about.models))
        takes = await about.takes(self._service)
        if not wanted and about.model is not None and measured_takes(about.model, takes):
            wanted = about.model.short
        choice = first_choice(models, takes, wanted, on)
        if choice is None:
            ui.label(NOTHING).classes("studio-notice compare-notice").props('role="status"')
            await next_steps(self._service, about)
            return
        self._bar = ChoiceBar(models, takes, choice, self._show)
        self._walk = HiddenWalk(self._service)
        await self._sections()
        soon(self._begin)

    async def _sections(self) -> None:
        self._busy = ui.label("Comparing …").classes("compare-busy").props('role="status"')
        with ui.element("div").classes("compare-parts"):
            with ui.element("section").classes("finding"):
                heading(2, "Error of each rotation")
                self._errors = RotationErrors(self._studio, self._choose_rotation, self._again)
            with ui.element("section").classes("finding"):
                heading(2, "Measured and predicted")
                self._chart_title = ui.label("")
                self._chart = TimeChart(label="Measured, predicted and error over linked time")
                self._chart.on_moment(self._choose_moment)
                self._chart.on_window(self._zoom)
            with ui.element("section").classes("finding"):
                heading(2, "Where it fails")
                self._onward = ui.row().classes("choices")
                with ui.element("div").classes("compare-pair"):
                    with ui.element("div"):
                        self._stretch_title = ui.label("")
                        self._stretches = ui.element("ol").classes("stretches")
                    with ui.element("div"):
                        self._hand = ReplayedHand(self._service)
                        await self._hand.build(self._bar.choice.models[0].subject)
            with ui.element("div").classes("compare-pair"):
                with ui.element("section").classes("finding"):
                    heading(2, "The angle at cursor A, term by term")
                    self._terms = ui.element("div").classes("terms").props('aria-live="polite"')
                with ui.element("section").classes("finding"):
                    heading(2, "Error against a recorded column")
                    self._against = ErrorAgainstColumn(self._service, self._column, self._link)

    async def _begin(self) -> None:
        choice = self._bar.choice
        if await self._show(choice):
            return
        takes = usual_takes(choice.models, self._bar.takes)
        if takes != choice.takes:
            told = (*choice.notices, self._bar.told)
            await self._show(Choice(choice.models, takes, told))

    async def _again(self) -> None:
        await self._show(self._bar.choice)

    # What is shown

    async def _show(self, choice: Choice) -> bool:
        """Errors, then everything of the rotation; False, with a sentence, for what the service refuses."""
        if not choice.takes:
            self._bar.tell(
                f"No take of {choice.models[0].subject} with layout {choice.models[0].layout} has "
                "measured angles."
            )
            self._busy.set_text("")
            return False
        self._busy.set_text("Comparing …")
        body = {"takes": list(choice.takes)}
        rotation = self._rotation
        try:
            comparisons = await self._of_models(Comparison, choice, "compare", body)
            if rotation not in comparisons[0].rotations:
                rotation = worst_rotation(comparisons[0])
            series = await self._of_models(
                Series, choice, "series", body | {"rotation": rotation, "points": POINTS}
            )
        except Refusal as refusal:
            self._bar.tell(str(refusal))
            self._busy.set_text("")
            return False
        self._bar.choose(choice)
        self._comparisons, self._rotation = comparisons, rotation
        await self._hand.of(choice.models[0].subject)
        await self._walk.show(self._first_id)
        self._show_series(series)
        self._show_errors()
        self._busy.set_text("")
        await asyncio.gather(
            self._show_stretches(), self._against.show(self._first_id, self._body), self._explain()
        )
        return True

    async def _of_models(
        self, answer: type[Found], choice: Choice, route: str, body: Mapping[str, Any]
    ) -> list[Found]:
        """One answer a model, in their order."""
        asked = (self._service.ask(answer, f"/models/{each.id}/{route}", body) for each in choice.models)
        return list(await asyncio.gather(*asked))

    @property
    def _names(self) -> list[str]:
        return short_names(self._bar.choice.models)

    @property
    def _first_id(self) -> str:
        return self._bar.choice.models[0].id

    @property
    def _body(self) -> dict[str, Any]:
        return {"takes": list(self._bar.choice.takes), "rotation": self._rotation}

    @property
    def _key(self) -> str:
        """As long as it is the same, the chart stays where it was zoomed to."""
        return "|".join(self._bar.choice.takes)

    @property
    def _linked_moment(self) -> float:
        """Of cursor A, on the linked axis."""
        id, at_s = self._moment
        take = next(each for each in self._series[0].takes if each.take == id)
        return at_s - take.start_s + take.linked_s

    def _link(self) -> None:
        """The page's address, for others to open."""
        chosen = {
            "models": ",".join(each.short for each in self._bar.choice.models),
            "takes": ",".join(self._bar.choice.takes),
            "rotation": self._rotation,
            "column": self._against.column,
        }
        given = {name: value for name, value in chosen.items() if value}
        query = json.dumps("?" + urlencode(given, safe=","))
        self._client.run_javascript(f"history.replaceState({{}}, '', {query})")

    def _show_errors(self) -> None:
        found = list(zip(self._names, self._comparisons, strict=True))
        self._errors.show(self._first_id, found, self._rotation)

    def _show_series(self, series: list[Series]) -> None:
        self._series = series
        if self._moment[0] not in self._bar.choice.takes:
            self._moment = worst_moment(series[0])
        self._chart_title.set_text(
            f"{self._rotation}: dashed measured, solid predicted, band ± 1 claimed standard deviation; below "
            "the error (predicted minus measured). Takes stand after one another, on one axis of seconds."
        )
        self._chart.show(list(zip(self._names, series, strict=True)), key=self._key, at_s=self._linked_moment)
        self._link()

    async def _choose_rotation(self, rotation: str) -> None:
        if rotation != self._rotation and await self._turn_to(rotation):
            await asyncio.gather(self._against.show(self._first_id, self._body), self._explain())

    async def _turn_to(self, rotation: str) -> bool:
        """Its series and its row; False, with a sentence, for what the service refuses."""
        try:
            series = await self._of_models(
                Series, self._bar.choice, "series", self._body | {"rotation": rotation, "points": POINTS}
            )
        except Refusal as refusal:
            self._bar.tell(str(refusal))
            return False
        self._rotation = rotation
        self._show_series(series)
        self._show_errors()
        return True

    async def _zoom(self, from_s: float, to_s: float) -> None:
        """Finer points of what is shown, where some were left out."""
        if all(take.frames == len(take.time_s) for each in self._series for take in each.takes):
            return
        key = (self._bar.choice, self._rotation)
        window = {"from_s": from_s, "to_s": to_s, "points": POINTS}
        finer = await self._of_models(Series, self._bar.choice, "series", self._body | window)
        if key == (self._bar.choice, self._rotation):
            self._chart.show(
                list(zip(self._names, finer, strict=True)), key=self._key, at_s=self._linked_moment
            )

    # Where it fails

    async def _show_stretches(self) -> None:
        choice = self._bar.choice
        path = f"/models/{choice.models[0].id}/where"
        with refusals(self._stretch_title.set_text):
            found = await self._service.ask(WhereItFails, path, {"takes": list(choice.takes)})
            if choice != self._bar.choice:
                return
            self._stretch_title.set_text(
                f"Worst seconds of {self._names[0]}; a click replays one on the hand."
            )
            self._onward.clear()
            with self._onward:
                ui.label("Which physical effect is missing?")
                ui.link("Diagnose", f"/diagnose?model={choice.models[0].id}").classes("studio-link")
            self._stretches.clear()
            with self._stretches:
                for stretch in found.stretches:
                    self._stretch(stretch)

    def _stretch(self, stretch: Stretch) -> None:
        take = self._series[0].takes[stretch.number]
        begin, end = (at_s - take.start_s for at_s in (stretch.start_s, stretch.end_s))
        pose = f", {stretch.pose}" if stretch.pose else ""
        with (
            ui.element("li"),
            ui.element("button").classes("stretch").props('type="button"') as button,
        ):
            ui.label(f"{take.name}, {begin:.1f} to {end:.1f} s{pose}").classes("stretch-where")
            ui.label(
                f"{degrees(stretch.rmse_deg)} over all rotations, {stretch.rotation} "
                f"{degrees(stretch.rotation_rmse_deg)}"
            )
        button.on("click", partial(self._replay_stretch, stretch))

    async def _replay_stretch(self, stretch: Stretch) -> None:
        take = self._series[0].takes[stretch.number]
        begin, end = stretch.start_s, stretch.end_s
        self._moment = (take.take, begin)

        async def point_at_it() -> None:
            turned = stretch.rotation != self._rotation and await self._turn_to(stretch.rotation)
            to_linked = take.linked_s - take.start_s
            self._chart.show_stretch(begin + to_linked, end + to_linked)
            await self._show_terms()
            if turned:
                await self._against.show(self._first_id, self._body)

        await asyncio.gather(self._hand.play(self._first_id, take, begin, end), point_at_it())

    # A moment

    async def _choose_moment(self, take: str, at_s: float) -> None:
        if take in self._bar.choice.takes:
            self._moment = (take, at_s)
            await self._explain()

    async def _explain(self) -> None:
        """The hand and the angle's terms where cursor A is."""
        id, at_s = self._moment
        take = next(each for each in self._series[0].takes if each.take == id)
        await asyncio.gather(self._hand.play(self._first_id, take, at_s, at_s), self._show_terms())

    async def _show_terms(self) -> None:
        choice, names = self._bar.choice, self._names
        take, at_s = self._moment
        body = {"take": take, "at_s": at_s, "rotations": [self._rotation]}
        with refusals(self._bar.tell):
            found = await self._of_models(Explanation, choice, "explain", body)
            if choice != self._bar.choice:
                return
            self._terms.clear()
            with self._terms:
                start = next(each.start_s for each in self._series[0].takes if each.take == take)
                ui.label(f"{self._rotation} in {found[0].name} at {found[0].time_s - start:.3f} s")
                for name, answer in zip(names, found, strict=True):
                    angle_terms(name, answer)
