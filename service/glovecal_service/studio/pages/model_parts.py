"""A model taken apart: rotations and what they are read from, effects and their numbers; effects come out."""

from __future__ import annotations

from functools import partial
from urllib.parse import quote

from nicegui import ui

from glovecal_models.calibration.answer import ModelEffect
from glovecal_service.rest.model.answer import ModelInFull
from glovecal_service.studio.amounts import degrees
from glovecal_service.studio.heading import act, heading
from glovecal_service.studio.service import Refusal, Service, refusals
from glovecal_service.studio.table import table, text_row

ROTATION_HEADS = ("Rotation", "Kind", "Read from", "Regression", "Held-out error", "Noise")


class ModelParts:
    """Hidden until it is opened; then asked for once."""

    def __init__(self, service: Service, model: str) -> None:
        self._service, self._model = service, model
        self._body = ui.expansion("Look inside", on_value_change=self._open).props("dense")
        self._body.classes("model-parts")
        self._is_shown = False

    async def _open(self) -> None:
        if self._is_shown or not self._body.value:
            return
        self._is_shown = True
        with self._body:
            try:
                found = await self._service.read(ModelInFull, f"/models/{self._model}")
            except Refusal as refusal:
                ui.label(str(refusal)).classes("studio-problem")
                return
            for number, effect in enumerate(found.effect_details, 1):
                heading(3, f"Effect {number}: {effect.effect}")
                ui.label(effect.explanation)
                _numbers(effect)
                act(f"Take {effect.effect} out", partial(self._out, effect.effect))
            heading(3, f"Base: {found.method}")
            with table("Rotations of the model", ROTATION_HEADS):
                for one in found.rotations:
                    text_row(
                        one.rotation, one.kind, ", ".join(one.sensors) or "other rotations",
                        one.method, degrees(one.held_out_rmse_deg), degrees(one.noise_deg),
                    )  # fmt: skip

    async def _out(self, effect: str) -> None:
        """The job is followed where the error falls."""
        with refusals():
            await self._service.delete(f"/models/{self._model}/effects/{quote(effect)}")
            ui.navigate.to(f"/fall?model={self._model}")


def _numbers(effect: ModelEffect) -> None:
    names = list(dict.fromkeys(name for own in effect.parameters.values() for name in own))
    if not names:
        return
    with table(f"What {effect.effect} learned", ("Rotation", *names)):
        for rotation, own in effect.parameters.items():
            text_row(rotation, *("–" if own.get(name) is None else f"{own[name]:.4g}" for name in names))
