"""The thread that turns frames into poses: takes what arrived, predicts, publishes, keeps the books.

Turns go round the models: gloves that share a model share a turn and one prediction. A round of turns is
kept to a few milliseconds by what earlier turns cost, and takes the newest frames; normally that is all.
So under overload every glove still gets fresh poses, fewer of them, and the frames left out are counted.
"""

from __future__ import annotations

import gc
import time
from collections.abc import Callable, Iterable
from dataclasses import replace
from threading import Event

import numpy as np

from glovecal_client.errors import BadName
from glovecal_client.keys import parse_glove_key
from glovecal_client.wire.frame import Frame, FrameFlag
from glovecal_client.wire.pose import Pose, PoseFlag, encode_pose
from glovecal_service.realtime.arrivals import Arrival, Arrivals
from glovecal_service.realtime.corrected_frames import corrected
from glovecal_service.realtime.glove_lane import GloveLane, Waiting
from glovecal_service.realtime.refusal import Refusal, Refused
from glovecal_service.realtime.served_model import ServedModel, ServedModels
from glovecal_service.realtime.worn_gloves import WornGloves

OLDEST_NS = 25_000_000
"""A frame that waited longer is skipped; with the budget of a round this keeps a pose younger than 50 ms."""
ROUND_BUDGET_S = 0.020
STALE_AFTER_NS = 500_000_000
STALE_AGAIN_NS = 1_000_000_000
GLOVES_LIMIT = 256
FORGET_AFTER_NS = 600_000_000_000
_COLLECT_EVERY_NS = 10_000_000_000

# plain numbers: arithmetic with enumerations costs microseconds
_FRAME_SIMULATED = int(FrameFlag.SIMULATED)
_SIMULATED = int(PoseFlag.SIMULATED)
_EXTRAPOLATING = int(PoseFlag.EXTRAPOLATING)
_TOO_UNCERTAIN = int(PoseFlag.TOO_UNCERTAIN)
_POSE_FLAGS = (0, _EXTRAPOLATING, _TOO_UNCERTAIN, _EXTRAPOLATING | _TOO_UNCERTAIN)
"""A pose's flags by the union of its rotations' flags 1 (extrapolating) and 2 (too uncertain)."""
_NO_ANGLES = np.empty(0, np.float32)
_NO_FLAGS = np.empty(0, np.uint8)

PublishPose = Callable[[str, bytes], None]
"""Glove name and encoded pose."""


class PoseLoop:
    """Frames in, poses out. ``lanes`` may be read, by copying it, from any thread."""

    def __init__(
        self,
        arrivals: Arrivals,
        models: ServedModels,
        publish: PublishPose,
        worn: WornGloves,
        *,
        oldest_ns: int = OLDEST_NS,
        round_budget_s: float = ROUND_BUDGET_S,
    ) -> None:
        self._oldest_ns, self._round_budget_s = oldest_ns, round_budget_s
        self._arrivals = arrivals
        self._models = models
        self._publish = publish
        self._worn = worn
        self._lanes_by_key: dict[str, GloveLane] = {}
        self._pending: dict[GloveLane, None] = {}
        self._looked_for_stale_ns = 0
        self._collected_ns = time.monotonic_ns()
        self.unusable_keys = 0
        """Messages on keys that name no glove, or one glove too many."""

    @property
    def lanes(self) -> list[GloveLane]:
        return list(self._lanes_by_key.values())

    def run(self, stopped: Event) -> None:
        """Until ``stopped``."""
        while not stopped.is_set():
            self.step(0.1)

    def step(self, timeout_s: float) -> None:
        """Wait for a frame, then serve until nothing is pending."""
        first = self._arrivals.wait(timeout_s)
        if first is not None:
            self._sort_in([first])
            self._sort_in(self._arrivals.drain())
        while self._pending:
            self._take_turn()
            self._sort_in(self._arrivals.drain())
        self._look_around()

    def _sort_in(self, arrivals: Iterable[Arrival]) -> None:
        for arrival in arrivals:
            lane = self._lane(arrival.key)
            if lane is not None:
                lane.add(arrival.payload, arrival.received_ns)
                self._pending[lane] = None
        for key, count in self._arrivals.take_refused().items():
            lane = self._lane(key)
            if lane is not None:
                lane.add_skipped(count)

    def _lane(self, key: str) -> GloveLane | None:
        lane = self._lanes_by_key.get(key)
        if lane is None:
            lane = self._new_lane(key)
        return lane

    def _new_lane(self, key: str) -> GloveLane | None:
        try:
            keys, _ = parse_glove_key(key)
        except BadName:
            self.unusable_keys += 1
            return None
        if len(self._lanes_by_key) >= GLOVES_LIMIT and not self._forget_a_silent_lane():
            self.unusable_keys += 1
            return None
        lane = self._lanes_by_key[key] = GloveLane(keys)
        return lane

    def _forget_a_silent_lane(self) -> bool:
        key, lane = min(self._lanes_by_key.items(), key=lambda item: item[1].last_received_ns)
        if time.monotonic_ns() - lane.last_received_ns < FORGET_AFTER_NS:
            return False
        del self._lanes_by_key[key]
        return True

    def _take_turn(self) -> None:
        started = time.perf_counter()
        model = self._models.of(next(iter(self._pending)).glove)
        lanes = [lane for lane in self._pending if self._models.of(lane.glove) is model]
        if model is None:
            for lane in lanes:
                self._serve_uncalibrated(lane)
            return
        share = len(lanes) / len(self._pending)  # so that all models have had a turn within the budget
        allowed = model.pace.frames_within(self._round_budget_s * share)
        lanes = lanes[:allowed]
        served = self._serve(model, lanes, allowed // len(lanes))
        model.pace.observe(served, time.perf_counter() - started)

    def _serve(self, model: ServedModel, lanes: list[GloveLane], limit: int) -> int:
        opened: list[tuple[GloveLane, Frame, int]] = []
        for lane in lanes:
            opened.extend((lane, *item) for item in self._open(lane, model, limit))
        if opened:
            self._predict_and_send(model, opened)
        return len(opened)

    def _predict_and_send(self, model: ServedModel, opened: list[tuple[GloveLane, Frame, int]]) -> None:
        try:
            angles = model.predict([frame.readings for _, frame, _ in opened])
        except (ArithmeticError, ValueError, np.linalg.LinAlgError) as error:
            for lane, frame, _ in opened:
                lane.refusals.add(_not_predictable(frame, model, str(error)))
            return
        angles, effect_flags = corrected(model, opened, angles, self._worn)
        usable: list[bool] = np.min(np.isfinite(angles.mean + angles.sd), axis=1).tolist()
        any_flags = np.bitwise_or.reduce(angles.flags, axis=1).tolist()
        mean, sd = angles.mean.astype(np.float32), angles.sd.astype(np.float32)
        for row, (lane, frame, received_ns) in enumerate(opened):
            if not usable[row]:
                lane.refusals.add(_not_predictable(frame, model, "an angle is not finite"))
                continue
            flags = _simulated(frame) | _POSE_FLAGS[any_flags[row] & 3] | effect_flags[row]
            values = (mean[row], sd[row], angles.flags[row], model.model_id, flags)
            self._send(lane, frame, received_ns, *values)

    def _serve_uncalibrated(self, lane: GloveLane) -> None:
        lane.effects = None
        for frame, received_ns in self._open(lane, None, len(lane)):
            flags = int(PoseFlag.UNCALIBRATED) | _simulated(frame)
            self._send(lane, frame, received_ns, _NO_ANGLES, _NO_ANGLES, _NO_FLAGS, None, flags)

    def _open(self, lane: GloveLane, model: ServedModel | None, limit: int) -> list[tuple[Frame, int]]:
        self._pending.pop(lane)
        opened = []
        for waiting in lane.newest(limit, time.monotonic_ns() - self._oldest_ns):
            frame = _checked(lane, waiting, model)
            if frame is not None:
                opened.append((frame, waiting.received_ns))
        return opened

    def _send(
        self,
        lane: GloveLane,
        frame: Frame,
        received_ns: int,
        degrees: np.ndarray,
        deviations: np.ndarray,
        rotation_flags: np.ndarray,
        model_id: str | None,
        flags: int,
    ) -> None:
        pose = Pose(
            frame.sequence, frame.run_id, frame.monotonic_ns, frame.wall_ns, degrees, deviations,
            rotation_flags, model_id, flags, lane.skipped_in_run, _age_us(received_ns),
        )  # fmt: skip
        self._publish(lane.glove, encode_pose(pose))
        lane.predicted += 1
        lane.model_id = model_id
        lane.last_pose, lane.last_pose_received_ns = pose, received_ns

    def _look_around(self) -> None:
        now = time.monotonic_ns()
        if now - self._looked_for_stale_ns < 100_000_000:
            return
        self._looked_for_stale_ns = now
        for lane in self._lanes_by_key.values():
            self._repeat_stale(lane, now)
        if now - self._collected_ns >= _COLLECT_EVERY_NS:
            self._collected_ns = now
            gc.collect(1)

    def _repeat_stale(self, lane: GloveLane, now: int) -> None:
        """Half a second after the last good frame, and once a second from then on: the last pose, marked."""
        pose = lane.last_pose
        if pose is None or now - lane.last_pose_received_ns < STALE_AFTER_NS:
            return
        if now - lane.stale_published_ns < STALE_AGAIN_NS:
            return
        lane.stale_published_ns = now
        age_us = _age_us(lane.last_pose_received_ns)
        flags = pose.flags | int(PoseFlag.STALE)
        stale = replace(pose, flags=flags, age_us=age_us, skipped=lane.skipped_in_run)
        self._publish(lane.glove, encode_pose(stale))


def _checked(lane: GloveLane, waiting: Waiting, model: ServedModel | None) -> Frame | None:
    frame = lane.open(waiting)
    if frame is None or model is None:
        return frame
    try:
        model.check(frame.readings)
    except Refused as refused:
        lane.refusals.add(refused)
        return None
    return frame


def _not_predictable(frame: Frame, model: ServedModel, why: str) -> Refused:
    return Refused(
        Refusal.NOT_PREDICTABLE, f"model {model.model_id[:12]} cannot predict frame {frame.sequence}: {why}"
    )


def _simulated(frame: Frame) -> int:
    return _SIMULATED if frame.flags & _FRAME_SIMULATED else 0


def _age_us(received_ns: int) -> int:
    return min((time.monotonic_ns() - received_ns) // 1000, 0xFFFFFFFF)
