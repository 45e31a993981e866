"""A pose loop without zenoh: frames of gloves go straight in, poses come out."""

from __future__ import annotations

import time
from collections.abc import Iterable
from queue import SimpleQueue
from typing import Any, cast

import numpy as np

from glovecal_client.keys import GloveKeys
from glovecal_client.wire.frame import Frame, encode_frame
from glovecal_client.wire.pose import Pose, decode_pose
from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.predictor import GloveAngles, GlovePredictor
from glovecal_service.incoming.arrivals import Arrival, Arrivals
from glovecal_service.realtime.glove_lanes import GlovePipeline
from glovecal_service.realtime.lane_effects import GloveContext, WornGloves
from glovecal_service.realtime.pose_loop import PoseLoop, corrected
from glovecal_service.realtime.served_model import ServedModel, ServedModels


class ByHand:
    """Stands for ``Arrivals``: what a test hands in."""

    def __init__(self) -> None:
        self.queue: SimpleQueue[Arrival] = SimpleQueue()

    def wait(self) -> Arrival | None:
        return None if self.queue.empty() else self.queue.get()

    def drain(self) -> list[Arrival]:
        return [self.queue.get() for _ in range(self.queue.qsize())]


class LoopByHand:
    """A pose loop without zenoh: frames in, poses by glove out."""

    def __init__(self) -> None:
        self.arrivals, self.models, self.worn = ByHand(), ServedModels(), WornGloves()
        self.poses: dict[str, list[Pose]] = {}
        # so much time that a slow machine skips no frame either
        self.loop = PoseLoop(
            cast(Arrivals, self.arrivals), self.models, self._publish, self.worn,
            oldest_ns=600 * 10**9, round_budget_s=600.0,
        )  # fmt: skip

    @classmethod
    def serving(cls, model: CalibrationModel) -> LoopByHand:
        """With ``model`` for glove ``g1``."""
        by_hand = cls()
        by_hand.serve("g1", model)
        return by_hand

    def _publish(self, glove: str, message: bytes) -> None:
        pose = decode_pose(message)
        if not pose.stale:  # on a slow machine the loop says again what is a second old
            self.poses.setdefault(glove, []).append(pose)

    def serve(self, glove: str, model: CalibrationModel, number: int = 1) -> None:
        self.models.put(glove, ServedModel.prepare(f"{number:064x}", model))

    def say(self, glove: str, *, run_id: int = 1, wearing: str = "w", context: tuple[str, ...] = ()) -> None:
        self.worn.put(glove, GloveContext(f"{run_id:016x}", wearing, context))

    def send(self, frames: Iterable[tuple[str, Frame]], *, together: int = 4) -> None:
        """So many frames wait whenever the loop looks."""
        for number, (glove, frame) in enumerate(frames, start=1):
            key = GloveKeys("lab", glove).raw
            self.arrivals.queue.put(Arrival(key, encode_frame(frame), time.monotonic_ns()))
            if number % together == 0:
                self.loop.step()
        self.loop.step()

    def stream(self, frames: Iterable[Frame], *, together: int = 4) -> None:
        """Frames of glove ``g1``."""
        self.send((("g1", frame) for frame in frames), together=together)

    def status(self, glove: str) -> dict[str, Any]:
        return next(lane.status(lambda *_: 0) for lane in self.loop.lanes if lane.glove == glove)


def served_in_turns(
    model: CalibrationModel, turns: Iterable[list[tuple[str, Frame]]]
) -> dict[str, GloveAngles]:
    """Angles by glove, before they are rounded for the wire, of turns that may hold many gloves' frames."""
    served, worn = ServedModel.prepare("1" * 64, model), WornGloves()
    lanes: dict[str, GlovePipeline] = {}
    found: dict[str, list[GloveAngles]] = {}
    for turn in turns:
        readings = np.array([frame.readings for _, frame in turn], dtype=np.float64)
        opened = [
            (lanes.setdefault(glove, GlovePipeline(GloveKeys("lab", glove))), frame, 0)
            for glove, frame in turn
        ]
        angles, *_ = corrected(served, opened, readings, served.predictor.predict(readings), worn)
        for row, (glove, _) in enumerate(turn):
            one = GloveAngles(*(getattr(angles, name)[row : row + 1] for name in _ANGLES))
            found.setdefault(glove, []).append(one)
    return {
        glove: GloveAngles(*(np.concatenate([getattr(one, name) for one in each]) for name in _ANGLES))
        for glove, each in found.items()
    }


_ANGLES = ("mean", "sd", "flags")


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
