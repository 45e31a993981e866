"""Joint angles over time, estimated with what came before and for a stated delay after (fixed-lag smoothing).

The motion is that of ``motion_smoother``, and so are its steps forward and backward. What a recording can be
asked as a whole is asked of the past: all smoothnesses run forward side by side, and of each joint that of
the largest likelihood until then is taken, where the far past counts less and less. A live glove and a take
are estimated by the same frames, so that they agree.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from glovecal_models.calibration.motion_smoother import (
    LEAST_NOISE_DEG2,
    SHORTEST_RUN,
    STATES,
    TIMES_S,
    Later,
    MotionFilter,
    SmoothedMotion,
    disturbance,
    in_degrees,
    smoothed,
    smoothed_state,
    transition,
    unsmoothed,
)
from glovecal_models.effects.base.dynamics import unbroken

MEMORY_S = 30.0
"""The likelihood of frames so long ago counts 1 / e."""
NOISE_EVERY_S = 0.01
"""The times are those of frames so far apart; the rate of a live glove is not known beforehand."""
_JERK = (NOISE_EVERY_S / TIMES_S)[:, None, None]
CLOCK_S = 1e-6
"""Times that differ by less are equal."""
FIRST_KEPT = 64
SMOOTHED_AT_ONCE = 512
"""Of a take, which bounds the memory."""


def delayed(
    time_s: np.ndarray, angles: np.ndarray, known: np.ndarray, delays_s: Sequence[float]
) -> list[SmoothedMotion]:
    """``angles`` (N, L) as of ``smoothed``, once for each of the ``delays_s``: each frame by those up to so
    many seconds after it, by all where that is infinite."""
    motions = [
        smoothed(time_s, angles, known) if np.isinf(delay) else unsmoothed(angles) for delay in delays_s
    ]
    finite = [(delay, motion) for delay, motion in zip(delays_s, motions, strict=True) if np.isfinite(delay)]
    for run in unbroken(time_s) if finite else ():
        smoother, times = FixedLagSmoother(angles.shape[1]), time_s[run]
        ends = [last_seen(times, delay) for delay, _ in finite]
        for start in range(0, len(times), SMOOTHED_AT_ONCE):
            stop = min(start + SMOOTHED_AT_ONCE, len(times))
            for frame in range(start, stop):
                at = run.start + frame
                smoother.add(float(times[frame]), angles[at], known[at])
            for (_, motion), end in zip(finite, ends, strict=True):
                # Those whose last frame came with these.
                numbers = np.flatnonzero((end >= start) & (end < stop))
                if len(numbers):
                    motion.put(run.start + numbers, smoother.estimates(numbers, end[numbers]))
            smoother.forget(min(int(np.searchsorted(end, stop)) for end in ends))
    return motions


def last_seen(time_s: np.ndarray, delay_s: float) -> np.ndarray:
    """(N,): for each frame at rising ``time_s`` (N,) the number of the last that came within ``delay_s``."""
    return np.searchsorted(time_s, time_s + delay_s + CLOCK_S, side="right") - 1


class FixedLagSmoother:
    """One unbroken run of frames of L joints; frames are kept as long as ``forget`` leaves them."""

    def __init__(self, joints: int) -> None:
        self.frames = 0
        """That were added; their numbers begin at 0."""
        self._joints = joints
        self._first = self._needed = 0
        """Numbers of the frame in row 0, and of the first that is still asked for."""
        self._filter: MotionFilter | None = None
        self._last_s = 0.0
        self._seen = np.zeros(joints, np.int64)
        every, own = (len(TIMES_S), joints), (len(TIMES_S), 1)
        self._square, self._log_spread, self._count = np.zeros(every), np.zeros(own), np.zeros(1)
        self._rows: dict[str, np.ndarray] = {
            "angle": np.empty((FIRST_KEPT, joints)),
            "known": np.empty((FIRST_KEPT, joints), bool),
            "seen": np.empty((FIRST_KEPT, joints), np.int64),
            "forward": np.empty((FIRST_KEPT, len(TIMES_S), STATES, STATES)),
            "state": np.empty((FIRST_KEPT, *every, STATES)),
            "error": np.empty((FIRST_KEPT, *every)),
            "square": np.empty((FIRST_KEPT, *every)),
            # Of all joints together until one of them is not known.
            "covariance": np.empty((FIRST_KEPT, *own, STATES, STATES)),
            "gain": np.empty((FIRST_KEPT, *own, STATES)),
            "weight": np.empty((FIRST_KEPT, *own)),
            "log_spread": np.empty((FIRST_KEPT, *own)),
            "count": np.empty((FIRST_KEPT, 1)),
        }

    def add(self, time_s: float, angle: np.ndarray, known: np.ndarray) -> None:
        """The next frame: ``angle`` (L,), degrees, which does not count where not ``known`` (L,)."""
        if self._filter is None:
            self._filter = MotionFilter(np.broadcast_to(angle, (len(TIMES_S), len(angle))))
            self._last_s = time_s
        elapsed, self._last_s = max(time_s - self._last_s, 0.0), time_s
        if not known.all() and self._is_shared:
            self._part_joints()
        which = slice(1) if self._is_shared else slice(None)
        counts = known[which].astype(float)
        h = elapsed / TIMES_S
        forward = transition(h)
        one = self._filter.step(forward, disturbance(h) * _JERK, angle, counts)
        # The first frames tell the state, not the noise.
        tells = np.where(self._seen[which] >= STATES, counts, 0.0)
        error = one.innovation * one.weight
        decay = np.exp(-elapsed / MEMORY_S)
        self._square = decay * self._square + tells * error * one.innovation
        spread = np.log(one.weight, where=one.weight > 0, out=np.zeros_like(one.weight))
        self._log_spread = decay * self._log_spread - tells * spread
        self._count = decay * self._count + tells
        self._seen = self._seen + known
        row = self._row_of_next()
        for name, value in (
            ("angle", angle), ("known", known), ("seen", self._seen), ("forward", forward),
            ("state", one.state), ("error", error), ("square", self._square), ("covariance", one.covariance),
            ("gain", one.gain), ("weight", one.weight), ("log_spread", self._log_spread),
            ("count", self._count),
        ):  # fmt: skip
            self._rows[name][row] = value
        self.frames += 1

    def estimates(self, numbers: np.ndarray, ends: np.ndarray) -> SmoothedMotion:
        """Of frames ``numbers`` (n,), by frames up to ``ends`` (n,), which are none before them."""
        rows, joints = self._rows, np.arange(self._joints)
        column = np.zeros_like(joints) if self._is_shared else joints
        end = ends - self._first
        count = np.maximum(rows["count"][end], 1e-9)
        noise = np.maximum(rows["square"][end] / count[:, None], LEAST_NOISE_DEG2)
        score = count[:, None] * np.log(noise) + rows["log_spread"][end]
        best = np.argmin(score, axis=1)
        noise = np.take_along_axis(noise, best[:, None], axis=1)[:, 0]
        later, longest = Later.nothing(*best.shape), int((ends - numbers).max())
        for ahead in range(longest, -1, -1):
            frame = numbers + ahead
            inside = (frame <= ends)[:, None]
            row = np.minimum(frame, ends)[:, None] - self._first
            if ahead < longest:
                after = np.minimum(row + 1, self.frames - 1 - self._first)
                later = later.before(rows["forward"][after, best])
            later = later.measured(
                rows["gain"][row, best, column],
                np.where(inside, rows["error"][row, best, joints], 0.0),
                np.where(inside, rows["weight"][row, best, column], 0.0),
            )
        row = numbers[:, None] - self._first
        state, covariance = smoothed_state(
            rows["state"][row, best, joints], rows["covariance"][row, best, column], *later
        )
        row, seen = row[:, 0], rows["seen"][end]
        is_measured = (seen > rows["seen"][row] - rows["known"][row]) & (seen >= SHORTEST_RUN)
        motion = in_degrees(state, covariance, TIMES_S[best], noise, is_measured)
        for array in (motion.state, motion.covariance, motion.noise):
            array[~is_measured] = 0.0
        motion.state[~is_measured, 0] = rows["angle"][row][~is_measured]
        return motion

    def forget(self, before: int) -> None:
        """Frames with a smaller number are asked for no more."""
        self._needed = before

    @property
    def _is_shared(self) -> bool:
        """Whether all joints were known so far: then one covariance is that of all."""
        return len(self._count) < self._joints

    def _row_of_next(self) -> int:
        room = len(self._rows["count"])
        if self.frames - self._first == room:
            kept = slice(self._needed - self._first, room)
            for name, array in self._rows.items():
                if kept.start < room // 2:
                    array = self._rows[name] = np.concatenate([array, np.empty_like(array)])
                array[: room - kept.start] = array[kept].copy()
            self._first = self._needed
        return self.frames - self._first

    def _part_joints(self) -> None:
        """From now on each joint has a covariance of its own."""
        self._count = np.repeat(self._count, self._joints)
        self._log_spread = np.repeat(self._log_spread, self._joints, axis=1)
        for name in ("covariance", "gain", "weight", "log_spread"):
            self._rows[name] = np.repeat(self._rows[name], self._joints, axis=2)
        self._rows["count"] = np.repeat(self._rows["count"], self._joints, axis=1)
