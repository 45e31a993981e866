"""The error of one rotation against a recorded column, beside what chance reaches."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from nicegui import ui
from nicegui.events import ValueChangeEventArguments

from glovecal_models.comparison.series.answer import ResidualColumn
from glovecal_service.studio.charts.chart import ColumnChart
from glovecal_service.studio.service import Refusal, Service


class ErrorAgainstColumn:
    """A choice of columns, and the chart of the chosen one."""

    def __init__(self, service: Service, column: str, on_choice: Callable[[], None]) -> None:
        """``column``: chosen at first, empty for the angle itself; ``on_choice``: told of another choice."""
        self._service = service
        self.column = column
        """What was asked for; empty: the angle itself."""
        self._shown = ""
        self._on_choice = on_choice
        self._asked: tuple[str, Mapping[str, Any]] = ("", {})
        self._select = (
            ui.select({}, label="Column", on_change=self._choose).props("stack-label").classes("choice")
        )
        self._chart = ColumnChart(label="Error against the chosen column")
        self._sentence = ui.label("").props('role="status"')

    async def show(self, model: str, body: Mapping[str, Any]) -> None:
        """``body``: takes and the rotation."""
        self._asked = (model, body)
        try:
            answer = await self._service.ask(
                ResidualColumn, f"/models/{model}/residual", {**body, "column": self.column or "angle"}
            )
        except Refusal as refusal:
            self._sentence.set_text(str(refusal))
            if self.column:
                self.column = ""
                await self.show(model, body)
                self._sentence.set_text(f"{refusal} {self._sentence.text}")
            return
        if self._asked != (model, body):
            return
        names = {one.name: one.phrase[:1].upper() + one.phrase[1:] for one in answer.columns}
        self._shown = answer.column.name
        self._select.set_options(names, value=self._shown)
        self._chart.show(answer)
        self._sentence.set_text(
            f"{answer.sentence} The band is what 95 % of the same errors, shifted in time, reach."
        )

    async def _choose(self, event: ValueChangeEventArguments) -> None:
        if event.value in (None, self._shown):
            return
        self.column = str(event.value)
        self._on_choice()
        await self.show(*self._asked)
