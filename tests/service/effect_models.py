"""Models with effects made by hand, and gloves whose frames go straight into a pose loop."""

from __future__ import annotations

import time
from collections.abc import Iterable
from dataclasses import replace
from queue import SimpleQueue
from typing import Any

import numpy as np
from realtime_support import LAYOUT, linear_model

from glovecal_client.keys import GloveKeys
from glovecal_client.wire.frame import Frame, encode_frame
from glovecal_client.wire.pose import Pose, decode_pose
from glovecal_models.calibration.added_effect import AddedEffect
from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.predictor import GlovePredictor
from glovecal_models.effects.catalogue import stored_effect
from glovecal_service.realtime.arrivals import Arrival
from glovecal_service.realtime.pose_loop import PoseLoop
from glovecal_service.realtime.served_model import ServedModel, ServedModels
from glovecal_service.realtime.worn_gloves import WornGlove, WornGloves

UNITS: dict[str, Any] = {"own_centre_deg": [20.0], "own_scale_deg": [30.0]}
"""Settings of effects that read the joint in its own units; one lane stands for all."""


def added(
    name: str,
    shape: Iterable[float],
    weights: Iterable[float],
    rotations: tuple[str, ...] = LAYOUT.rotations,
    settings: dict[str, Any] | None = None,
) -> AddedEffect:
    """The same shape and weights on each of ``rotations``; weights that are not given are zero."""
    lanes, settings = len(rotations), settings or {}
    learned = np.array(list(weights), dtype=float)
    missing = len(stored_effect(name, settings).weight_names(settings)) - len(learned)
    learned = np.pad(learned, (0, missing))
    grid = np.tile(np.array(list(shape), dtype=float), (lanes, 1))
    return AddedEffect(name, rotations, settings, grid, np.tile(learned, (lanes, 1)), np.zeros(lanes))


HYSTERESIS = added("hysteresis", (5.0,), (0.4, 0.3, 0.2))
CREEP = added("creep", (0.5, 2.5), (0.1, 0.15, 0.05, 0.1), ("I_MCP", "M_MCP"), settings=UNITS)
LAG = added("lag", (0.05,), (0.2, 0.3, 0.1), ("I_PIP",))


def model_with(*effects: AddedEffect) -> CalibrationModel:
    base = linear_model("anna", degrees_per_count=0.5)
    return replace(base, effects=effects, sensor_centre=np.full(3, 120.0), sensor_scale=np.full(3, 50.0))


class ByHand:
    """Stands for ``Arrivals``: what a test hands in."""

    def __init__(self) -> None:
        self.queue: SimpleQueue[Arrival] = SimpleQueue()

    def wait(self, timeout_s: float) -> Arrival | None:
        return None if self.queue.empty() else self.queue.get()

    def drain(self) -> list[Arrival]:
        return [self.queue.get() for _ in range(self.queue.qsize())]

    def take_refused(self) -> dict[str, int]:
        return {}


class LoopByHand:
    """A pose loop without zenoh: frames in, poses by glove out."""

    def __init__(self) -> None:
        self.arrivals, self.models, self.worn = ByHand(), ServedModels(), WornGloves()
        self.poses: dict[str, list[Pose]] = {}
        self.loop = PoseLoop(self.arrivals, self.models, self._publish, self.worn)  # type: ignore[arg-type]

    def _publish(self, glove: str, message: bytes) -> None:
        self.poses.setdefault(glove, []).append(decode_pose(message))

    def serve(self, glove: str, model: CalibrationModel, number: int = 1) -> None:
        self.models.put(glove, ServedModel.prepare(f"{number:064x}", model))

    def say(self, glove: str, *, run_id: int = 1, wearing: str = "w", context: tuple[str, ...] = ()) -> None:
        self.worn.put(glove, WornGlove(f"{run_id:016x}", wearing, context))

    def send(self, frames: Iterable[tuple[str, Frame]], *, together: int = 4) -> None:
        """So many frames wait whenever the loop looks."""
        for number, (glove, frame) in enumerate(frames, start=1):
            key = GloveKeys("lab", glove).raw
            self.arrivals.queue.put(Arrival(key, encode_frame(frame), time.monotonic_ns()))
            if number % together == 0:
                self.loop.step(0.0)
        self.loop.step(0.0)

    def status(self, glove: str) -> dict[str, Any]:
        return next(lane.status() for lane in self.loop.lanes if lane.glove == glove)


def moving_frames(count: int, *, seed: int = 0, run_id: int = 1, start_s: float = 1000.0) -> list[Frame]:
    """At uneven times, about 100 a second."""
    random = np.random.default_rng(seed)
    time_ns = (1e9 * (start_s + np.cumsum(random.uniform(0.005, 0.015, count)))).astype(int)
    phase = np.arange(count)[:, None] / 25.0 + np.arange(3)
    readings = (120 + 60 * np.sin(phase) + random.normal(0, 1, (count, 3))).astype(np.float32)
    return [
        Frame(number, run_id, int(time_ns[number]), int(time_ns[number]), readings[number])
        for number in range(count)
    ]


def as_take(model: CalibrationModel, frames: list[Frame], wearing: str = "w") -> np.ndarray:
    """Degrees (N, R) of the frames predicted as a recorded take."""
    time_s = np.array([frame.monotonic_ns for frame in frames]) / 1e9
    readings = np.array([frame.readings for frame in frames], dtype=np.float64)
    return GlovePredictor(model).predict_take(time_s, readings, {}, wearing).mean


def degrees(poses: list[Pose]) -> np.ndarray:
    return np.array([pose.degrees for pose in poses])


def assert_published(poses: list[Pose], expected: np.ndarray) -> None:
    """To the last bit but one of what a pose can hold."""
    np.testing.assert_array_max_ulp(degrees(poses), expected.astype(np.float32), 1)
