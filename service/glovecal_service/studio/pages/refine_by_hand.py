"""Refinement by hand on a live glove: scale and offset of a rotation by sliders, every change a version."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from functools import partial
from urllib.parse import quote

from nicegui import ui
from nicegui.events import GenericEventArguments

from glovecal_service.rest.model.answer import ActivationView, Model, ModelInFull
from glovecal_service.studio.amounts import version_name
from glovecal_service.studio.pages.refined_video import RefinedVideo
from glovecal_service.studio.service import Refusal, refusals
from glovecal_service.studio.studio import Studio

LEAST_SCALE, MOST_SCALE, SCALE_STEP = 0.5, 2.0, 0.01
MOST_OFFSET_DEG, OFFSET_STEP_DEG = 45.0, 0.5
NEUTRAL = (1.0, 0.0)
"""Scale and offset that change nothing."""
WHAT = (
    "Turn the angle until the hand looks right beside the real one. Each release of a slider makes a version "
    "and serves it; its error is not measured."
)


class RefineByHand:
    """Hidden where the served model has no line to refine. ``changed``: told when another model is served."""

    def __init__(self, studio: Studio, changed: Callable[[], Awaitable[None]]) -> None:
        self._studio, self._changed = studio, changed
        self._model: Model | None = None
        self._served: list[tuple[float, float]] = [NEUTRAL]
        """Where the sliders stood at each version made here, the one that is served last."""
        self._replaced: set[str | None] = set()
        """Models that were served before a change made here."""
        self._doubted: str | None = None
        self._changing = asyncio.Lock()
        """A slider released, or Undo pressed, while another version is made waits for it."""
        with ui.expansion("Refine by hand").classes("refine") as self._part:
            ui.label(WHAT)
            self._rotation = ui.select([], label="Rotation", on_change=self._begin).classes("choice")
            self._scale = self._slider("Scale, times", LEAST_SCALE, MOST_SCALE, SCALE_STEP, 1.0)
            self._offset = self._slider(
                "Offset, degrees", -MOST_OFFSET_DEG, MOST_OFFSET_DEG, OFFSET_STEP_DEG, 0.0
            )
            with ui.row():
                ui.button("Undo", on_click=self._undo).props("outline no-caps")
            self._said = ui.label("").classes("refine-said").props('role="status"')
            self._video = RefinedVideo(studio)
        self._part.set_visibility(False)

    @property
    def _id(self) -> str | None:
        return None if self._model is None else self._model.id

    async def follow(self, model: str | None) -> None:
        """The model that is served now, or was when it was asked for."""
        if self._changing.locked():
            return
        if model == self._id:
            self._doubted = None
            return
        if model in self._replaced and model != self._doubted:
            # The question may be older than the change; told a second time, it was taken back elsewhere.
            self._doubted = model
            return
        self._model = None
        self._begin()
        lines: list[str] = []
        if model is not None:
            try:
                self._model = found = await self._studio.service.read(ModelInFull, f"/models/{quote(model)}")
            except Refusal:
                self._part.set_visibility(False)
                return
            lines = _lines(found)
        kept = self._rotation.value if self._rotation.value in lines else next(iter(lines), None)
        self._rotation.set_options(lines, value=kept)
        self._part.set_visibility(bool(lines))
        if lines and self._model is not None:
            await self._video.follow(self._model)

    def _slider(self, label: str, least: float, most: float, step: float, neutral: float) -> ui.slider:
        with ui.element("div").classes("refine-slider"):
            ui.label(label)
            shown = ui.label(f"{neutral:g}").classes("refine-value")
            slider = ui.slider(min=least, max=most, step=step, value=neutral).props(f'aria-label="{label}"')
            slider.on_value_change(lambda event: shown.set_text(f"{event.value:g}"))
            slider.on("change", partial(self._released, slider))
        return slider

    async def _released(self, slider: ui.slider, event: GenericEventArguments) -> None:
        """The value comes with the event: that of the slider may still be on its way."""
        slider.set_value(float(event.args))
        async with self._changing:
            await self._apply()

    async def _apply(self) -> None:
        """Make the version at which the sliders stand out of the one that is served."""
        wanted, now = (self._scale.value or 1.0, self._offset.value or 0.0), self._served[-1]
        if wanted == now:
            return
        rotation, before = self._rotation.value, self._id
        scale = wanted[0] / now[0]
        change = {"scale": scale, "offset_deg": wanted[1] - scale * now[1]}
        body = {"rotations": {rotation: change}, "activate": True}
        try:
            self._model = await self._studio.service.ask(Model, f"/models/{before}/refine", body)
        except Refusal as refusal:
            self._said.set_text(str(refusal))
            self._stand(now)
        else:
            self._served.append(wanted)
            self._replaced.add(before)
            version = version_name(self._model)
            self._said.set_text(
                f"{rotation} times {wanted[0]:g}, {wanted[1]:+g} degrees: {version} is served."
            )
            await self._video.follow(self._model)
            await self._changed()

    def _begin(self) -> None:
        """From the served version on."""
        self._served = [NEUTRAL]
        self._stand(NEUTRAL)

    def _stand(self, at: tuple[float, float]) -> None:
        self._scale.set_value(at[0])
        self._offset.set_value(at[1])

    async def _undo(self) -> None:
        async with self._changing:
            await self._take_back()

    async def _take_back(self) -> None:
        model = self._model
        if model is None:
            return
        which = {"subject": model.subject, "layout": model.layout, "hand": model.hand}
        with refusals(self._said.set_text):
            back = await self._studio.service.ask(ActivationView, "/models/rollback", which)
            self._served = self._served[:-1] or [NEUTRAL]
            self._stand(self._served[-1])
            self._replaced.add(model.id)
            self._model = model.model_copy(update={"id": back.model})
            self._said.set_text(f"Taken back: {self._model.short} is served again.")
            await self._video.follow(self._model)
            await self._changed()


def _lines(model: ModelInFull) -> list[str]:
    """Rotations that may be refined: as REST would refuse the others."""
    corrected = {rotation for effect in model.effect_details for rotation in effect.parameters}
    return [
        each.rotation
        for each in model.rotations
        if each.method == "linear" and each.rotation not in corrected
    ]
