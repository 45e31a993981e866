"""The frames of one turn with their model's effects: predicted together, and corrected together.

A state goes from frame to frame of a glove, so where several frames of a glove are in one turn, the first
ones of all gloves are corrected first, then the second ones, and so on.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence

import numpy as np

from glovecal_client.wire.frame import Frame
from glovecal_client.wire.pose import PoseFlag
from glovecal_models.calibration.correction_parts import CorrectionParts
from glovecal_models.calibration.effect_correction import EffectCorrection, usable_correction
from glovecal_models.calibration.interval_inflation import VarianceInflation
from glovecal_models.calibration.predictor import GloveAngles
from glovecal_service.realtime.frame_record import Effects
from glovecal_service.realtime.glove_lane import GloveLane
from glovecal_service.realtime.lane_effects import LaneEffects
from glovecal_service.realtime.served_model import ServedModel
from glovecal_service.realtime.worn_gloves import WornGloves

_FAULTY_SENSOR = int(PoseFlag.FAULTY_SENSOR)


def corrected(
    model: ServedModel,
    opened: Sequence[tuple[GloveLane, Frame, int]],
    readings: np.ndarray,
    angles: GloveAngles,
    worn: WornGloves,
) -> tuple[GloveAngles, list[int]]:
    """``angles`` of the ``opened`` frames with the effects, and flags for each pose.

    ``readings`` (N, S) are theirs. Frames of a glove must be in order; those of several may be mixed.
    """
    flags = [0] * len(opened)
    recorded = [row for row, (lane, _, _) in enumerate(opened) if lane.record is not None]
    if not model.predictor.has_effects:
        for lane, _, _ in opened:
            lane.effects = None
        for row in recorded:
            _write_down(model, opened[row], readings[row], angles.row(row), None)
        return angles, flags
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
    return model.predictor.corrected(angles, turn.correction, turn.undefined, turn.inflation), flags


def _write_down(
    model: ServedModel,
    item: tuple[GloveLane, Frame, int],
    readings: np.ndarray,
    base: GloveAngles,
    effects: Effects | None,
) -> None:
    """Of several frames of a glove the last one stays."""
    lane, frame, _ = item
    record = lane.record
    if record is not None:
        record.predicted(model, frame, readings, base, effects)


def _successive(opened: Sequence[tuple[GloveLane, Frame, int]], is_wanted: np.ndarray) -> Sequence[list[int]]:
    """Rows of the gloves' first frames, of their second ones ..."""
    wanted: list[bool] = is_wanted.tolist()
    successive: list[list[int]] = []
    taken: defaultdict[GloveLane, int] = defaultdict(int)
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
