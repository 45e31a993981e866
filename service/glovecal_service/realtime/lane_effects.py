"""The effects of one glove's model: their state from frame to frame, and when it has to start anew.

Time is the capture computer's monotonic clock, the same that a recorded take has. Frames that were skipped or
lost are not made up: the recursions take the time that really passed, as they do in a take with holes. After
more than a second without a frame every effect with a memory forgets (it does so itself, in takes too), and
a new run, a new wearing or another model starts all of them anew.
"""

from __future__ import annotations

import logging
from collections import Counter
from typing import Any, NamedTuple

import numpy as np

from glovecal_client.wire.frame import Frame
from glovecal_client.wire.pose import PoseFlag
from glovecal_models.calibration.doubt import Doubt
from glovecal_models.calibration.effect_correction import usable_correction
from glovecal_models.effects.history_effect import LONGEST_GAP_S
from glovecal_service.realtime.served_model import ServedModel
from glovecal_service.realtime.worn_gloves import WornGlove

_RESET = int(PoseFlag.STATE_RESET)
_SETTLING = int(PoseFlag.SETTLING)
_FAULTY_SENSOR = int(PoseFlag.FAULTY_SENSOR)

_log = logging.getLogger("glovecal.realtime")


class Correction(NamedTuple):
    """What the effects say about one frame."""

    degrees: np.ndarray
    """(R,), to be added to the base's prediction; may hold what is unusable."""
    flags: int
    """PoseFlag bits."""
    undefined: np.ndarray | None = None
    """(R,) True where an effect had no value and was left out; None: nowhere."""
    doubt: Doubt | None = None
    """What the effects add to the claimed variance, and where a sensor fails; None: nothing."""


class LaneEffects:
    """One glove with one model. Belongs to the predicting thread; ``status`` may be asked by others."""

    def __init__(self, model: ServedModel) -> None:
        self.model = model
        self.starts = 0
        """How often an effect with a memory began anew."""
        self.unusable = 0
        """Frames in which some correction had no value, was no number or absurd: flagged, and left out."""
        self.faulty: Counter[str] = Counter()
        """Frames in which each sensor failed."""
        self._stream = model.predictor.stream()
        self._run_id: int | None = None
        self._wearing = ""
        self._started_s = 0.0
        self._last_s = 0.0
        self._settling = False
        self._seen: tuple[frozenset[str], str] | None = None

    def correct(self, frame: Frame, worn: WornGlove, base: np.ndarray) -> Correction:
        """``base``: the finite prediction (R,) of the next frame, degrees. Raises nothing."""
        time_s = frame.monotonic_ns / 1e9
        wearing = worn.wearing_of(frame)
        begins = self._begins(frame.run_id, wearing)
        flags = self._follow(time_s, begins)
        context = worn.context_of(frame, self._stream.context)
        self._seen = frozenset(context), wearing
        try:
            if begins:
                self._stream.reset()
            readings = frame.readings.astype(np.float64)
            degrees = self._stream.of_frame(time_s, base, readings, context, wearing)
        except Exception as error:  # an effect may be somebody else's code; the poses must go on
            degrees = np.zeros_like(base)
            degrees[self._stream.rows] = np.nan
            self._give_up(str(error) or type(error).__name__)
        else:
            if not usable_correction(degrees).all():
                self._give_up("a correction is no number, or more than a full turn")
            elif self._stream.undefined is not None:
                self._count("an effect has no value for some readings")
        doubt = self._stream.doubt
        if self._stream.faulty_sensors:
            self.faulty.update(self._stream.faulty_sensors)
        if doubt is not None and doubt.is_faulty.any():
            flags |= _FAULTY_SENSOR
        return Correction(degrees, flags, self._stream.undefined, doubt)

    def status(self) -> dict[str, Any]:
        """For the status document: what is not corrected, and why; which sensors fail."""
        seen = self._seen
        failing = [
            f"sensor {name} fails: the rotations read from it keep their last good angle"
            for name in self._stream.faulty_sensors
        ]
        return {
            "settling": self._settling,
            "starts": self.starts,
            "unusable_corrections": self.unusable,
            "faulty_frames": dict(self.faulty),
            "sentences": failing + ([] if seen is None else list(self._stream.silent(*seen))),
        }

    def _begins(self, run_id: int, wearing: str) -> bool:
        """Whether the frame is the first of a run or a wearing."""
        # The name of a wearing often comes after its first frames: that is no other wearing.
        is_other = bool(wearing and self._wearing and wearing != self._wearing)
        begins = run_id != self._run_id or is_other
        self._wearing = wearing if begins else wearing or self._wearing
        self._run_id = run_id
        return begins

    def _follow(self, time_s: float, begins: bool) -> int:
        """The pose's flags about the state."""
        settling_s = self._stream.settling_s
        is_start = begins or not 0.0 <= time_s - self._last_s <= LONGEST_GAP_S
        self._last_s = time_s
        if not settling_s:
            return 0
        if is_start:
            self._started_s = time_s
            self.starts += 1
        self._settling = time_s - self._started_s < settling_s
        return (_RESET if is_start else 0) | (_SETTLING if self._settling else 0)

    def _give_up(self, problem: str) -> None:
        """Start anew with the next frame: a state that is no number would stay so for ever."""
        self._count(problem)
        self._run_id = None

    def _count(self, problem: str) -> None:
        if not self.unusable:
            name = self.model.model_id[:12]
            _log.warning("model %s: its effects do not correct every frame: %s", name, problem)
        self.unusable += 1
