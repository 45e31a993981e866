"""A glove's poses as a robot's actions: mapped, ramped in, held when they cannot be trusted, then refused.

Knows nothing of LeRobot.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol

from glovecal_client import Pose
from glovecal_client.wire.pose import PoseFlag, RotationFlag


class GloveNotUsable(RuntimeError):
    """The glove's poses must not move a robot; the sentence says why and what to do."""


@dataclass
class JointAction:
    """One action: ``offset`` plus the sum of ``gains`` (action units a degree) times rotations by name."""

    gains: dict[str, float]
    offset: float = 0.0
    low: float = -math.inf
    high: float = math.inf
    rest: float | None = None
    """Where the robot is before it follows; None: where all rotations are 0 degrees."""

    def __post_init__(self) -> None:
        """Raises ValueError."""
        numbers = [self.offset, *self.gains.values(), *([] if self.rest is None else [self.rest])]
        if not all(map(math.isfinite, numbers)):
            raise ValueError("gains, offset and rest of an action must be finite numbers")
        if not self.low < self.high:
            raise ValueError(f"the limits of an action must be low < high, not {self.low} and {self.high}")

    def value(self, degrees: Mapping[str, float]) -> float:
        return self._limited(self.offset + sum(gain * degrees[name] for name, gain in self.gains.items()))

    @property
    def start(self) -> float:
        return self._limited(self.offset if self.rest is None else self.rest)

    def _limited(self, value: float) -> float:
        return min(max(value, self.low), self.high)


class HandMapping(Protocol):
    """What a robot is told, made of a hand's rotations."""

    @property
    def rotations(self) -> set[str]:
        """That it is made of: each has to be there and to be trusted."""
        ...

    @property
    def start(self) -> dict[str, float]:
        """Where the robot is before it follows, by the names of its actions."""
        ...

    def know(self, meta: Mapping[str, Any]) -> None:
        """What ``pose/meta`` says of the poses that come now. Raises GloveNotUsable."""
        ...

    def values(self, degrees: Mapping[str, float]) -> dict[str, float]:
        """Its actions, within their limits, where the hand's rotations are these."""
        ...


@dataclass
class SummedRotations:
    """Each action is a sum of rotations."""

    actions: Mapping[str, JointAction]

    def __post_init__(self) -> None:
        """Raises ValueError."""
        if not self.actions:
            raise ValueError("actions: name each action of the robot, and the rotations it is made of")

    @property
    def rotations(self) -> set[str]:
        return {name for action in self.actions.values() for name in action.gains}

    @property
    def start(self) -> dict[str, float]:
        return {name: action.start for name, action in self.actions.items()}

    def know(self, meta: Mapping[str, Any]) -> None:
        """Nothing: rotations are summed whoever's they are."""

    def values(self, degrees: Mapping[str, float]) -> dict[str, float]:
        return {name: action.value(degrees) for name, action in self.actions.items()}


@dataclass
class JointActions:
    """A robot's actions from pose to pose, and whether the hand may move them."""

    glove: str
    mapping: HandMapping
    hold_s: float = 0.2
    ramp_s: float = 2.0
    allow_simulated: bool = False
    _began_s: float | None = field(default=None, init=False)
    _trusted_s: float = field(default=0.0, init=False)
    _start: dict[str, float] = field(default_factory=dict, init=False)
    _last: dict[str, float] = field(default_factory=dict, init=False)
    _ended: str = field(default="", init=False)
    _model: str | None = field(default=None, init=False)

    def begin(self, pose: Pose | None, names: tuple[str, ...], is_late: bool) -> None:
        """Follow from now on. Raises GloveNotUsable with what has to be done first."""
        why = self.problem(pose, names, is_late)
        if why:
            raise GloveNotUsable(f"glove {self.glove} cannot move a robot: {why}")
        self._began_s, self._ended, self._model = None, "", None if pose is None else pose.model_sha256
        self._start = self._last = self.mapping.start

    def at(self, now_s: float, pose: Pose | None, names: tuple[str, ...], is_late: bool) -> dict[str, float]:
        """The actions at ``now_s`` (seconds of one clock); ``is_late``: no new pose came
        for a while.

        What cannot be trusted holds the last actions for ``hold_s``. Raises GloveNotUsable after that, and
        from then on, until ``begin``.
        """
        if self._ended:
            raise GloveNotUsable(self._ended)
        if self._began_s is None:
            self._began_s = self._trusted_s = now_s
        why = self.problem(pose, names, is_late)
        if not why and pose is not None and pose.model_sha256 != self._model:
            why = "another model was made active meanwhile, whose angles may differ at once."
        if not why and pose is not None:
            self._trusted_s = now_s
            degrees = dict(zip(names, pose.degrees.tolist(), strict=True))
            part = 1.0 if self.ramp_s <= 0 else min(1.0, (now_s - self._began_s) / self.ramp_s)
            self._last = {
                name: (1.0 - part) * self._start[name] + part * value
                for name, value in self.mapping.values(degrees).items()
            }
        elif now_s - self._trusted_s > self.hold_s:
            self._ended = (
                f"glove {self.glove} stopped moving the robot after {self.hold_s:g} s: {why} The robot was "
                "last sent where it is; begin again when the glove is well."
            )
            raise GloveNotUsable(self._ended)
        return dict(self._last)

    def problem(self, pose: Pose | None, names: tuple[str, ...], is_late: bool) -> str:
        """Why the pose must not move a robot, a sentence; "" if it may."""
        watch = f"See: glovecal watch {self.glove}."
        if pose is None:
            return f"no pose of it came; are glovecal serve and its capture running? {watch}"
        if pose.flags & PoseFlag.UNCALIBRATED:
            return f"it is not calibrated: no model is active for who wears it. {watch}"
        if pose.flags & PoseFlag.SIMULATED and not self.allow_simulated:
            return "it is simulated; to try it all the same, set allow_simulated."
        if pose.flags & PoseFlag.STALE or is_late:
            return f"its pose is stale: nothing new comes from the glove. {watch}"
        missing = sorted(self.mapping.rotations - set(names))
        if missing:
            return (
                f"its model has no rotation {missing[0]}, of which an action is made; it has "
                f"{', '.join(names)}."
            )
        return self._problem_of_rotations(pose, names, watch)

    def _problem_of_rotations(self, pose: Pose, names: tuple[str, ...], watch: str) -> str:
        wanted = self.mapping.rotations
        for name, degrees, sd_deg, flags in zip(
            names, pose.degrees.tolist(), pose.deviations.tolist(), pose.rotation_flags.tolist(), strict=True
        ):
            if name not in wanted:
                continue
            if not math.isfinite(degrees):
                return f"rotation {name} is no number. {watch}"
            if flags & RotationFlag.FAULTY_SENSOR:
                return f"a sensor of rotation {name} is faulty. {watch}"
            if flags & RotationFlag.TOO_UNCERTAIN:
                return f"rotation {name} is too uncertain (SD {sd_deg:.1f} degrees). {watch}"
        return ""
