"""What effects add to the prediction of one live frame: two with a memory, on every rotation of the glove."""

from __future__ import annotations

import timeit
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from glovecal_client.keys import GloveKeys
from glovecal_client.wire.frame import Frame
from glovecal_models.calibration.added_effect import AddedEffect
from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.effects.catalogue import (
    stored_correction,
)
from glovecal_service.realtime.glove_lanes import GlovePipeline
from glovecal_service.realtime.lane_effects import WornGloves
from glovecal_service.realtime.pose_loop import corrected
from glovecal_service.realtime.served_model import ServedModel

FRAMES = 2000
MOST_ADDED_MS = 0.2


def cost_of_effects(base: CalibrationModel, frames_count: int = FRAMES) -> dict[str, Any]:
    """Milliseconds a frame without and with hysteresis and creep on all rotations of ``base``."""
    names = base.rotation_names
    lanes, sensors = len(names), len(base.layout.sensors)
    effects = (everywhere("hysteresis", names, [4.0]), everywhere("creep", names, [0.6, 2.4, 10.0]))
    model = ServedModel.prepare("1" * 64, replace(base, effects=effects))
    lane, worn = GlovePipeline(GloveKeys("bench", "glove")), WornGloves()
    readings = np.random.default_rng(1).uniform(60, 190, (frames_count, sensors)).astype(np.float32)
    frames = [Frame(number, 1, number * 8_333_333, 0, row) for number, row in enumerate(readings)]

    def without() -> None:
        for row in readings:
            model.predictor.predict(row[None])

    def with_effects() -> None:
        for frame in frames:
            row = frame.readings[None].astype(np.float64)
            corrected(model, [(lane, frame, 0)], row, model.predictor.predict(row), worn)

    before, after = (_seconds(work) / frames_count * 1e3 for work in (without, with_effects))
    return {
        "case": f"two effects on {lanes} rotations, {sensors} sensors, one frame, no network",
        "without_ms": before,
        "with_ms": after,
        "ratio": after / before,
        "targets": [
            {
                "figure": "added_ms",
                "is": "<=",
                "value": MOST_ADDED_MS,
                "met": bool(after - before <= MOST_ADDED_MS),
            }
        ],
        "added_ms": after - before,
    }


def everywhere(name: str, rotations: tuple[str, ...], shape: Sequence[float]) -> AddedEffect:
    """An effect of the catalogue on all ``rotations`` with the same nonlinear parameters; small weights."""
    lanes, effect = len(rotations), stored_correction(name, {})
    weights = np.full((lanes, len(effect.weights({}).names)), 0.1)
    return AddedEffect(name, rotations, {}, np.tile(shape, (lanes, 1)), weights, np.zeros(lanes))


def sentence(cost: dict[str, Any]) -> str:
    """One line for the terminal."""
    met = "met" if cost["targets"][0]["met"] else "MISSED"
    return (
        f"{cost['case']}: {cost['without_ms']:.3f} ms without, {cost['with_ms']:.3f} ms with: "
        f"x {cost['ratio']:.2f}, {met} added_ms <= {MOST_ADDED_MS}: {cost['added_ms']:.3f}"
    )


def _seconds(work: Callable[[], None]) -> float:
    return min(timeit.repeat(work, number=1, repeat=3))
