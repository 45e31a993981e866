"""The effects of one glove's model: their state from frame to frame, and when it has to start anew.

They have to know which wearing a run is, and what the glove's context values mean.

Time is the capture computer's monotonic clock, the same that a recorded take has. Frames that were skipped or
lost are not made up: the recursions take the time that really passed, as they do in a take with holes. After
more than a second without a frame every effect with a memory forgets (it does so itself, in takes too), and a
new run, a new wearing or another model starts all of them anew.
"""

from __future__ import annotations

import logging
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from glovecal_client.wire.frame import Frame
from glovecal_client.wire.pose import PoseFlag
from glovecal_models.effects.base.dynamics import LONGEST_GAP_S
from glovecal_models.takes.take import KnownLatency
from glovecal_service.plain import reason_of
from glovecal_service.realtime.served_model import ServedModel


@dataclass(frozen=True)
class GloveContext:
    """What was said about one glove."""

    run_id: str = ""
    """The run that the wearing is of, 16 hexadecimal digits."""
    wearing: str = ""
    """"" when nobody said."""
    context: tuple[str, ...] = ()
    """Names of a frame's context values, in order."""
    latency_ns: int = 0
    """How long before a frame's time the hand was as it shows; 0 if nobody measured it."""
    delay_ns: int = 0
    """How long a pose waits for the frames after it."""
    sensors: tuple[str, ...] = ()
    """Names of a frame's readings, in order; empty while capture has not said them."""

    @classmethod
    def of(
        cls,
        meta: Mapping[str, Any] | None,
        wearing: str | None,
        latency: KnownLatency | None = None,
        delay_ms: int = 0,
    ) -> GloveContext:
        """``meta`` as capture said it, ``wearing`` as the store has it (it knows later assignments too)."""
        meta = meta or {}
        names = meta.get("context")
        context = tuple(map(str, names)) if isinstance(names, list) else ()
        latency_ns = 0 if latency is None else round(1e9 * latency.seconds)
        said = meta.get("sensors")
        sensors = tuple(map(str, said)) if isinstance(said, list) else ()
        delay_ns = 1_000_000 * delay_ms
        return cls(str(meta.get("run_id") or ""), wearing or "", context, latency_ns, delay_ns, sensors)

    def wearing_of(self, frame: Frame) -> str:
        """A run of which nothing was said yet is a wearing of its own, without a name."""
        return self.wearing if self.run_id == f"{frame.run_id:016x}" else ""

    def context_of(self, frame: Frame, wanted: tuple[str, ...]) -> dict[str, float]:
        """Those of the ``wanted`` columns that this frame has a value of.

        Nothing when the frame has another number of values than there are names.
        """
        if not wanted or len(frame.context) != len(self.context):
            return {}
        values = dict(zip(self.context, frame.context.tolist(), strict=True))
        return {name: values[name] for name in wanted if not np.isnan(values.get(name, np.nan))}


class WornGloves:
    """Written by the model watcher, read between frames."""

    def __init__(self) -> None:
        self._gloves: dict[str, GloveContext] = {}

    def of(self, glove: str) -> GloveContext:
        return self._gloves.get(glove, _UNKNOWN)

    def put(self, glove: str, worn: GloveContext) -> None:
        self._gloves[glove] = worn

    def forget(self, glove: str) -> None:
        self._gloves.pop(glove, None)


_UNKNOWN = GloveContext()


_RESET = int(PoseFlag.STATE_RESET)
_SETTLING = int(PoseFlag.SETTLING)

_log = logging.getLogger("glovecal.realtime")


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
        self.stream = model.predictor.stream()
        self.context: Mapping[str, float] = {}
        self.wearing = ""
        """Both of the last frame, as the effects are told."""
        self._run_id: int | None = None
        self._wearing = ""
        self._started_s = 0.0
        self._last_s = 0.0
        self._settling = False

    def begin_frame(self, frame: Frame, worn: GloveContext) -> int:
        """Look at the next frame, reset what has to start anew with it; the pose's flags about the state."""
        wearing = worn.wearing_of(frame)
        begins = self._begins(frame.run_id, wearing)
        flags = self._follow(frame.monotonic_ns / 1e9, begins)
        self.context, self.wearing = worn.context_of(frame, self.stream.context), wearing
        if begins:
            try:
                self.stream.reset()
            except Exception as error:  # an effect may be somebody else's code; the poses must go on
                self.stream = self.model.predictor.stream()
                self._count(f"an effect cannot start anew: {reason_of(error)}")
        return flags

    def end_frame(self, problem: str, *, is_undefined: bool) -> None:
        """``problem``: why the frame's correction cannot be used, "" if it can; then they start anew."""
        if problem:
            self._count(problem)
            self._run_id = None  # a state that is no number would stay so for ever
        elif is_undefined:
            self._count("an effect has no value for some readings")
        if self.stream.faulty_sensors:
            self.faulty.update(self.stream.faulty_sensors)

    @property
    def since_start_s(self) -> float:
        """How long before the last frame the effects with a memory began anew."""
        return self._last_s - self._started_s

    def status(self) -> dict[str, Any]:
        """For the status document: what is not corrected, and why; which sensors fail."""
        failing = [
            f"sensor {name} fails: the rotations read from it keep their last good angle"
            for name in self.stream.faulty_sensors
        ]
        return {
            "settling": self._settling,
            "starts": self.starts,
            "unusable_corrections": self.unusable,
            "faulty_frames": dict(self.faulty),
            "sentences": failing + list(self.stream.silent(frozenset(self.context), self.wearing)),
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
        settling_s = self.stream.settling_s
        is_start = begins or not 0.0 <= time_s - self._last_s <= LONGEST_GAP_S
        self._last_s = time_s
        if not settling_s:
            return 0
        if is_start:
            self._started_s = time_s
            self.starts += 1
        self._settling = time_s - self._started_s < settling_s
        return (_RESET if is_start else 0) | (_SETTLING if self._settling else 0)

    def _count(self, problem: str) -> None:
        if not self.unusable:
            name = self.model.model_id[:12]
            _log.warning("model %s: its effects do not correct every frame: %s", name, problem)
        self.unusable += 1
