"""The picture of an effect with its sentence, and a choice of the rotation that it is drawn for."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from nicegui import ui
from nicegui.events import ValueChangeEventArguments

from glovecal_service.rest.effect.answer import EffectPictureView
from glovecal_service.studio.charts.chart import EffectChart
from glovecal_service.studio.service import Refusal, Service


class EffectView:
    """Shown where it is made; what the service refuses is said in the picture's place."""

    def __init__(
        self,
        service: Service,
        effect: str | Mapping[str, str],
        takes: Sequence[str],
        *,
        before: str,
        after: str | None,
    ) -> None:
        """``effect``: a name or ``{"declaration": text}``; ``before`` and ``after``: ids of models without
        and with it; ``takes``: ids."""
        self._service = service
        self._body = {"effect": effect, "takes": list(takes)}
        self._before, self._after = before, after
        with ui.element("div").classes("effect-view"):
            self._select = (
                ui.select({}, label="Rotation", on_change=self._choose)
                .props("stack-label")
                .classes("effect-rotation")
            )
            self._chart = EffectChart(label="The error that shows the effect")
            self._sentence = ui.label("Drawing …").props('role="status"').classes("effect-sentence")
        self._select.set_visibility(False)
        self._chart.set_visibility(False)
        self._shown = ""

    async def show(self, rotation: str | None) -> None:
        """None: the rotation with the largest error."""
        body, picture = self._body | {"rotation": rotation}, "/models/{}/effect-picture"
        try:
            before = await self._service.ask(EffectPictureView, picture.format(self._before), body)
            after = None
            if self._after is not None:
                body = self._body | {"rotation": before.rotation}
                after = await self._service.ask(EffectPictureView, picture.format(self._after), body)
        except Refusal as refusal:
            self._sentence.set_text(f"No picture: {refusal}")
            return
        self._shown = before.rotation
        self._select.set_options(before.rotations, value=self._shown)
        self._select.set_visibility(len(before.rotations) > 1)
        has_picture = bool(before.series)
        self._chart.set_visibility(has_picture)
        if has_picture:
            self._chart.show(before, after)
        self._sentence.set_text(before.sentence)

    async def _choose(self, event: ValueChangeEventArguments) -> None:
        if event.value and event.value != self._shown:
            await self.show(str(event.value))
