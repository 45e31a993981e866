"""The thread that turns frames into poses: takes what arrived, predicts, publishes, keeps the books.

Turns go round the models: gloves that share a model share a turn and one prediction. A turn takes the newest
frames, as many of each glove as keep a round of turns to a few milliseconds by what earlier turns cost;
normally that is all. Under overload it takes one of each glove, and the frames left out are counted: a frame
costs least in a full turn, so more load never means fewer poses, and every glove gets as many.

The frames of a turn are corrected by their model's effects together, too. A state goes from frame to frame of
a glove, so where several frames of a glove are in one turn, the first ones of all gloves are corrected first,
then the second ones, and so on.
"""

from __future__ import annotations

import gc
import logging
import time
from collections import defaultdict
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from threading import Event

import numpy as np

from glovecal_client.clock import clock_ns
from glovecal_client.wire.frame import Frame, FrameFlag
from glovecal_client.wire.pose import (
    Pose,
    PoseFlag,
    decode_pose,
    encode_around,
    encode_pose,
    encode_rotations,
)
from glovecal_models.calibration.correction_parts import CorrectionParts, VarianceInflation
from glovecal_models.calibration.effect_correction import EffectCorrection, usable_correction
from glovecal_models.calibration.predictor import GloveAngles
from glovecal_models.calibration.servable import LARGEST_DEG
from glovecal_service.incoming.arrivals import Arrival, Arrivals
from glovecal_service.incoming.frame_gate import Refusal, Refused
from glovecal_service.incoming.glove_owners import GloveOwners
from glovecal_service.realtime.delayed_poses import DelayedPoses, LiveFrame
from glovecal_service.realtime.frame_record import Effects
from glovecal_service.realtime.glove_lanes import GlovePipeline, GlovePipelines
from glovecal_service.realtime.lane_effects import LaneEffects, WornGloves
from glovecal_service.realtime.served_model import ServedModel, ServedModels

OLDEST_NS = 25_000_000
"""A frame that waited longer is skipped; with the budget of a round this keeps a pose younger than 50 ms."""
ROUND_BUDGET_S = 0.020
MODEL_WITHIN_NS = 10_000_000_000
STALE_AFTER_NS = 500_000_000
STALE_AGAIN_NS = 1_000_000_000
_COLLECT_EVERY_NS = 10_000_000_000

# plain numbers: arithmetic with enumerations costs microseconds
_FRAME_SIMULATED = int(FrameFlag.SIMULATED)
_SIMULATED = int(PoseFlag.SIMULATED)
_EXTRAPOLATING = int(PoseFlag.EXTRAPOLATING)
_TOO_UNCERTAIN = int(PoseFlag.TOO_UNCERTAIN)
_POSE_FLAGS = (0, _EXTRAPOLATING, _TOO_UNCERTAIN, _EXTRAPOLATING | _TOO_UNCERTAIN)
"""A pose's flags by the union of its rotations' flags 1 (extrapolating) and 2 (too uncertain)."""

_log = logging.getLogger("glovecal.realtime")

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
        owners: GloveOwners | None = None,
        oldest_ns: int = OLDEST_NS,
        round_budget_s: float = ROUND_BUDGET_S,
    ) -> None:
        self._oldest_ns, self._round_budget_s = oldest_ns, round_budget_s
        self._arrivals = arrivals
        self._models = models
        self._publish = publish
        self._worn = worn
        self.gloves = GlovePipelines(owners)
        arrivals.left_out = self.gloves.left_out
        self._pending: dict[ServedModel | None, dict[GlovePipeline, None]] = {}
        """Gloves with frames that wait, by their models; the model whose turn is next comes first."""
        self._looked_for_stale_ns = 0
        self._collected_ns = clock_ns()
        self._failed: set[str] = set()
        self.turns = 0
        """How often it looked for frames or took a turn, which under load never ends; others may read it."""

    @property
    def lanes(self) -> list[GlovePipeline]:
        return self.gloves.all()

    def run(self, stopped: Event) -> None:
        """Until ``stopped``."""
        while not stopped.is_set():
            self.step()

    def step(self) -> None:
        """Wait for a frame, a tenth of a second at most, then serve until nothing is pending."""
        self.turns += 1
        first = self._arrivals.wait()
        if first is not None:
            self._enqueue([first])
            self._enqueue(self._arrivals.drain())
        while self._pending:
            self._take_turn()
            self._enqueue(self._arrivals.drain())
        self._housekeeping()

    def _enqueue(self, arrivals: Iterable[Arrival]) -> None:
        self.gloves.follow_owners()
        for arrival in arrivals:
            lane = self.gloves.of(arrival.key, arrival.payload, arrival.received_ns)
            if lane is not None and lane.add(arrival.payload, arrival.received_ns):
                self._let_wait(lane)

    def _let_wait(self, lane: GlovePipeline) -> None:
        self._pending.setdefault(self._models.of(lane.glove), {})[lane] = None

    def _take_turn(self) -> None:
        self.turns += 1
        started = time.perf_counter()
        waiting = sum(map(len, self._pending.values()))
        model = next(iter(self._pending))
        lanes: list[GlovePipeline] = []
        most = waiting if model is None else model.pace.frames_within(self._round_budget_s)
        for lane in self._pending.pop(model):
            if len(lanes) < most and self._models.of(lane.glove) is model:
                lanes.append(lane)
            else:
                self._let_wait(lane)
        if model is None:
            for lane in lanes:
                if not self._waits_for_a_model(lane):
                    self._serve_uncalibrated(lane)
            return
        if not lanes:
            return
        # several frames of each glove only while all models have had a turn within the budget
        share = len(lanes) / waiting
        limit = max(1, model.pace.frames_within(self._round_budget_s * share) // len(lanes))
        served = self._serve(model, lanes, limit)
        model.pace.observe(served, time.perf_counter() - started)

    def _serve(self, model: ServedModel, lanes: list[GlovePipeline], limit: int) -> int:
        opened: list[tuple[GlovePipeline, Frame, int]] = []
        for lane in lanes:
            delay_ns = self._worn.of(lane.glove).delay_ns
            if delay_ns or lane.delayed is not None:
                self._follow_delay(lane, model, delay_ns)
            for frame, received_ns in self._open(lane, limit):
                try:
                    model.check_count(frame.readings)
                except Refused as refused:
                    lane.refusals.add(refused)
                else:
                    opened.append((lane, frame, received_ns))
        if opened:
            try:
                self._predict_and_send(model, opened)
            except Exception:  # a model may come from elsewhere: its fault must not end other gloves' poses
                if model.model_id not in self._failed:
                    self._failed.add(model.model_id)
                    _log.exception("model %s fails on a frame", model.model_id[:12])
                for lane, frame, _ in opened:
                    lane.refusals.add(_not_predictable(frame, model, "it fails, the log says where"))
        return len(opened)

    def _predict_and_send(self, model: ServedModel, opened: list[tuple[GlovePipeline, Frame, int]]) -> None:
        readings = np.stack([frame.readings for _, frame, _ in opened]).astype(np.float64)
        refused = model.out_of_range(readings)
        if refused:
            for row, why in refused.items():
                opened[row][0].refusals.add(why)
            opened = [item for row, item in enumerate(opened) if row not in refused]
            readings = np.delete(readings, list(refused), axis=0)
        angles = model.predictor.predict(readings)
        angles, effect_flags, effects = corrected(model, opened, readings, angles, self._worn)
        goes = self._usable(model, opened, angles)
        for row, (lane, frame, received_ns) in enumerate(opened):
            if lane.delayed is not None and goes[row]:
                goes[row] = False
                live = LiveFrame(frame, received_ns, angles.row(row), effect_flags[row])
                self._delay(lane, lane.delayed, live, effects.get(row))
        if not goes.all():
            opened = [item for row, item in enumerate(opened) if goes[row]]
            effect_flags = [flags for row, flags in enumerate(effect_flags) if goes[row]]
            angles = GloveAngles(angles.mean[goes], angles.sd[goes], angles.flags[goes])
        if opened:
            self._send(model, opened, angles, effect_flags)

    def _usable(
        self, model: ServedModel, opened: Sequence[tuple[GlovePipeline, Frame, int]], angles: GloveAngles
    ) -> np.ndarray:
        """(N,) whether each frame's angles may be sent; those that may not are refused."""
        size = np.maximum(np.abs(angles.mean), np.abs(angles.sd))
        usable: np.ndarray = np.logical_and.reduce(size <= LARGEST_DEG, axis=1)  # NaN is not
        for row in () if usable.all() else np.flatnonzero(~usable).tolist():
            glove, frame, _ = opened[row]
            glove.refusals.add(_not_predictable(frame, model, "an angle is absurd or not finite"))
        return usable

    def _follow_delay(self, glove: GlovePipeline, model: ServedModel | None, delay_ns: int) -> None:
        """Have the glove's poses wait as long as somebody chose; those that wait otherwise go out."""
        waiting = glove.delayed
        if waiting is None or waiting.model is not model or waiting.delay_ns != delay_ns:
            if waiting is not None:
                self._send_due(glove, waiting, *waiting.rest())
            glove.delayed = None if model is None or not delay_ns else DelayedPoses(model, delay_ns)

    def _delay(
        self, glove: GlovePipeline, delayed: DelayedPoses, live: LiveFrame, effects: Effects | None
    ) -> None:
        record = glove.record
        if record is not None and record.is_of(live.frame):
            record.served(live.angles)  # its terms are those of a frame by itself
            glove.record = None
        self._send_due(glove, delayed, *delayed.add(live, effects))

    def _send_due(
        self,
        glove: GlovePipeline,
        delayed: DelayedPoses,
        due: Sequence[LiveFrame],
        angles: GloveAngles | None,
    ) -> None:
        if angles is None:
            return
        opened = [(glove, one.frame, one.received_ns) for one in due]
        usable = self._usable(delayed.model, opened, angles)
        for row in np.flatnonzero(usable).tolist():
            self._send(delayed.model, opened[row : row + 1], angles.row(row), [due[row].flags])

    def _send(
        self,
        model: ServedModel,
        opened: list[tuple[GlovePipeline, Frame, int]],
        angles: GloveAngles,
        effect_flags: list[int],
    ) -> None:
        rotations = encode_rotations(angles.mean.astype("<f4"), angles.sd.astype("<f4"), angles.flags)
        any_flags = np.bitwise_or.reduce(angles.flags, axis=1).tolist()
        for row, (item, of_frame, any_flag, effect_flag) in enumerate(
            zip(opened, rotations, any_flags, effect_flags, strict=True)
        ):
            lane, frame, received_ns = item
            flags = _simulated(frame) | _POSE_FLAGS[any_flag & 3] | effect_flag
            late_ns = self._worn.of(lane.glove).latency_ns
            message = encode_around(
                of_frame, frame.sequence, frame.run_id, frame.monotonic_ns - late_ns, frame.wall_ns - late_ns,
                model.name_in_pose, flags, lane.skipped_in_run, _age_us(received_ns - late_ns), lane.term,
            )  # fmt: skip
            self._publish(lane.glove, message)
            lane.note_pose(message, received_ns, model.model_id)
            watch = lane.watch_of(frame, model, model.sensors)
            watch.add(frame.monotonic_ns, frame.readings, angles.mean[row])
            record = lane.record  # another thread takes it away when it waited too long
            if record is not None and record.is_of(frame):
                record.served(angles.row(row))
                lane.record = None

    def _waits_for_a_model(self, glove: GlovePipeline) -> bool:
        """Of a glove that had angles elsewhere, frames are skipped until it is known by which model: poses
        without angles in between would be seen."""
        if glove.is_taken_over:
            late = clock_ns() - glove.first_received_ns > MODEL_WITHIN_NS
            glove.is_taken_over = not late and not self._models.is_chosen(glove.glove)
        if glove.is_taken_over:
            glove.skip(len(self._open(glove, 1)))
        return glove.is_taken_over

    def _serve_uncalibrated(self, lane: GlovePipeline) -> None:
        lane.effects = None
        self._follow_delay(lane, None, 0)
        late_ns = self._worn.of(lane.glove).latency_ns
        for frame, received_ns in self._open(lane, len(lane)):
            flags = int(PoseFlag.UNCALIBRATED) | _simulated(frame)
            pose = Pose(
                frame.sequence, frame.run_id, frame.monotonic_ns - late_ns, frame.wall_ns - late_ns,
                flags=flags, skipped=lane.skipped_in_run, age_us=_age_us(received_ns - late_ns),
                term=lane.term,
            )  # fmt: skip
            message = encode_pose(pose)
            self._publish(lane.glove, message)
            lane.note_pose(message, received_ns, None)
            watch = lane.watch_of(frame, None, self._worn.of(lane.glove).sensors)
            watch.add(frame.monotonic_ns, frame.readings, None)

    def _open(self, lane: GlovePipeline, limit: int) -> list[tuple[Frame, int]]:
        opened = []
        for waiting in lane.newest(limit, clock_ns() - self._oldest_ns):
            frame = lane.open(waiting)
            if frame is not None:
                opened.append((frame, waiting.received_ns))
        return opened

    def _housekeeping(self) -> None:
        now = clock_ns()
        if now - self._looked_for_stale_ns < 100_000_000:
            return
        self._looked_for_stale_ns = now
        for lane in self.gloves.all():
            if lane.delayed is not None:
                self._send_due(lane, lane.delayed, *lane.delayed.rest(now))
            self._repeat_stale(lane, now)
        if now - self._collected_ns >= _COLLECT_EVERY_NS:
            self._collected_ns = now
            gc.collect(1)

    def _repeat_stale(self, lane: GlovePipeline, now: int) -> None:
        """Half a second after the last good frame, and once a second from then on: the last pose, marked."""
        if lane.last_pose is None or now - lane.last_pose_received_ns < STALE_AFTER_NS or lane.delayed:
            return
        if now - lane.stale_published_ns < STALE_AGAIN_NS:
            return
        lane.stale_published_ns = now
        late_ns = self._worn.of(lane.glove).latency_ns
        pose, age_us = decode_pose(lane.last_pose), _age_us(lane.last_pose_received_ns - late_ns)
        flags = pose.flags | int(PoseFlag.STALE)
        stale = replace(pose, flags=flags, age_us=age_us, skipped=lane.skipped_in_run)
        self._publish(lane.glove, encode_pose(stale))


def _not_predictable(frame: Frame, model: ServedModel, why: str) -> Refused:
    return Refused(
        Refusal.NOT_PREDICTABLE, f"model {model.model_id[:12]} cannot predict frame {frame.sequence}: {why}"
    )


def _simulated(frame: Frame) -> int:
    return _SIMULATED if frame.flags & _FRAME_SIMULATED else 0


def _age_us(received_ns: int) -> int:
    return min(max((clock_ns() - received_ns) // 1000, 0), 0xFFFFFFFF)


_FAULTY_SENSOR = int(PoseFlag.FAULTY_SENSOR)


def corrected(
    model: ServedModel,
    opened: Sequence[tuple[GlovePipeline, Frame, int]],
    readings: np.ndarray,
    angles: GloveAngles,
    worn: WornGloves,
) -> tuple[GloveAngles, list[int], dict[int, Effects]]:
    """``angles`` of the ``opened`` frames with the effects, flags for each pose, and by their rows what the
    effects did with frames of which somebody has to know.

    ``readings`` (N, S) are theirs. Frames of a glove must be in order; those of several may be mixed.
    """
    flags = [0] * len(opened)
    recorded = [
        row for row, (lane, _, _) in enumerate(opened) if lane.record is not None or lane.delayed is not None
    ]
    if not model.predictor.has_effects:
        for lane, _, _ in opened:
            lane.effects = None
        for row in recorded:
            _write_down(model, opened[row], readings[row], angles.row(row), None)
        return angles, flags, {}
    turn = _Turn(angles.mean, frozenset(recorded))
    # What is no number gets no pose, and must not get into a state either.
    for rows in _successive(opened, np.logical_and.reduce(np.isfinite(angles.mean), axis=1)):
        gloves = [opened[row][0].effects_of(model) for row in rows]
        for row, effects in zip(rows, gloves, strict=True):
            lane, frame, _ = opened[row]
            flags[row] = effects.begin_frame(frame, worn.of(lane.glove))
        times = np.array([opened[row][1].monotonic_ns / 1e9 for row in rows])
        at = slice(None) if len(rows) == len(opened) else np.array(rows)
        turn.correct(rows, at, gloves, times, readings[at])
    if turn.inflation is not None:
        for row in np.flatnonzero(turn.inflation.is_faulty.any(axis=1)).tolist():
            flags[row] |= _FAULTY_SENSOR
    for row, effects in turn.recorded.items():
        _write_down(model, opened[row], readings[row], angles.row(row), effects)
    angles = model.predictor.corrected(angles, turn.correction, turn.undefined, turn.inflation)
    return angles, flags, turn.recorded


def _write_down(
    model: ServedModel,
    item: tuple[GlovePipeline, Frame, int],
    readings: np.ndarray,
    base: GloveAngles,
    effects: Effects | None,
) -> None:
    """Of several frames of a glove the last one stays."""
    lane, frame, _ = item
    record = lane.record
    if record is not None:
        record.predicted(model, frame, readings, base, effects)


def _successive(
    opened: Sequence[tuple[GlovePipeline, Frame, int]], is_wanted: np.ndarray
) -> Sequence[list[int]]:
    """Rows of the gloves' first frames, of their second ones ..."""
    wanted: list[bool] = is_wanted.tolist()
    successive: list[list[int]] = []
    taken: defaultdict[GlovePipeline, int] = defaultdict(int)
    for row, (lane, _, _) in enumerate(opened):
        if wanted[row]:
            if taken[lane] == len(successive):
                successive.append([])
            successive[taken[lane]].append(row)
            taken[lane] += 1
    return successive


class _Turn:
    """What the effects say about the N frames of a turn."""

    def __init__(self, base: np.ndarray, wanted: frozenset[int]) -> None:
        """What happens to the rows ``wanted`` is kept in ``recorded``."""
        self._base, self._wanted = base, wanted
        self.recorded: dict[int, Effects] = {}
        self.correction = np.zeros_like(base)
        self.undefined: np.ndarray | None = None
        self.inflation: VarianceInflation | None = None

    def correct(
        self,
        numbers: Sequence[int],
        rows: slice | np.ndarray,
        gloves: Sequence[LaneEffects],
        time_s: np.ndarray,
        readings: np.ndarray,
    ) -> None:
        """Frames ``numbers``, one of each glove; ``rows`` are the same as an index."""
        wanted = self._wanted.intersection(numbers) if self._wanted else self._wanted
        parts = CorrectionParts(len(numbers), self._base.shape[1]) if wanted else None
        found = EffectCorrection.of_frames(
            [glove.stream for glove in gloves],
            time_s,
            self._base[rows],
            readings,
            [glove.context for glove in gloves],
            [glove.wearing for glove in gloves],
            parts,
        )
        if parts is not None:
            for at, (row, glove) in enumerate(zip(numbers, gloves, strict=True)):
                if row in wanted:
                    self.recorded[row] = Effects(
                        found.degrees[at : at + 1], parts.of_frame(at), glove.stream, glove.context,
                        glove.wearing, glove.since_start_s,
                    )  # fmt: skip
        self.correction[rows] = found.degrees
        if found.undefined is not None:
            self.undefined = self._none() if self.undefined is None else self.undefined
            self.undefined[rows] = found.undefined
        if found.inflation is not None:
            self.inflation = self.inflation or VarianceInflation(np.zeros_like(self._base), self._none())
            self.inflation.variance[rows], self.inflation.is_faulty[rows] = found.inflation
        is_usable = usable_correction(found.degrees)
        if not found.problems and found.undefined is None and is_usable.all():
            for glove in gloves:
                glove.end_frame("", is_undefined=False)
            return
        usable: list[bool] = np.all(is_usable, axis=1).tolist()
        for row, glove in enumerate(gloves):
            problem = "" if usable[row] else "a correction is no number, or more than a full turn"
            glove.end_frame(
                found.problems.get(row, problem),
                is_undefined=found.undefined is not None and bool(found.undefined[row].any()),
            )

    def _none(self) -> np.ndarray:
        return np.zeros(self._base.shape, dtype=bool)
