"""A glove's own latency from taps of a finger on a key: when the key says it, and when the readings show it.

A finger that strikes a key moves fast and stops at the key's bottom. Each tap's readings become one signal,
the speed of the sensors that follow the taps; taps are aligned with each other by their shape, and the moment
where the mean speed has fallen to half its peak is the stop. Taps of another shape, or far from the others,
are left out. Keys report a press late, by a time that is mostly unknown: half the range of usual keys is
added to the result and its uncertainty to the standard deviation, unless the key's own latency is given.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from glovecal_models.errors import BadInput
from glovecal_models.takes.take import KnownLatency

FEWEST_TAPS = 20
USUAL_KEY_S = (0.005, 0.02)
"""Keyboards report a key so long after it was hit; any time between is taken for equally likely."""
TAP_STEP_S = 0.001
BEFORE_TAP_S, AFTER_TAP_S = 0.3, 0.7
"""Of a key's time: what is looked at, and so the latencies that can be found."""
EARLIEST_S, LATEST_S = -0.1, 0.4
"""Of the stop, from the key's time: a neighbouring tap is further away."""
APART_S = 0.4
"""Taps closer to another one are left out."""
STROKE_S = 0.15
"""Around the stop: the part of a tap whose shape is compared."""
SMOOTHING_S = 0.01
ALIGNED_WITHIN_S = 0.1
ROUNDS = 4
LEAST_CORRELATION = 0.7
MOST_DEVIATIONS = 4.0
"""Median absolute deviations of a normal distribution, by which a tap may lie off the median."""
LEAST_CONTRAST = 1.2
"""How much faster than the lift the strike must be, to be told from it."""
DRAWS = 1000


@dataclass(frozen=True)
class TapLatency:
    """What taps say of a glove's latency."""

    seconds: float
    """Median over taps, with the key's own latency added."""
    sd_s: float
    """Standard deviation of ``seconds``: bootstrap over taps, and the key's where it is not known."""
    tap_sd_s: float
    """Standard deviation of a single tap."""
    taps: int
    used: int
    sensors: tuple[str, ...]
    """Those that follow the taps most, the first first."""

    @property
    def known(self) -> KnownLatency:
        return KnownLatency(self.seconds, self.sd_s)

    @property
    def sentence(self) -> str:
        return (
            f"The glove is {1000 * self.seconds:.1f} ms late (SD {1000 * self.sd_s:.1f} ms; {self.used} of"
            f" {self.taps} taps; a single tap: SD {1000 * self.tap_sd_s:.1f} ms)."
        )


def tap_latency(
    time_s: np.ndarray,
    readings: np.ndarray,
    sensors: Sequence[str],
    key_s: np.ndarray,
    *,
    key_latency_s: float | None = None,
    seed: int = 0,
) -> TapLatency:
    """From frames, (N,) seconds and (N, S) readings, and the times (K,) of key presses on the same clock.

    ``key_latency_s``: how long the key takes to report a press; None: not known, a usual key
    (``USUAL_KEY_S``). Raises BadInput for fewer than ``FEWEST_TAPS`` taps that can be used, and where no
    sensor follows them.
    """
    keys = _usable(np.sort(np.asarray(key_s, dtype=float)), time_s)
    if len(keys) < FEWEST_TAPS:
        raise BadInput(
            f"{len(keys)} of {len(key_s)} taps have frames around them and are {APART_S} s from the next one;"
            f" {FEWEST_TAPS} are needed"
        )
    grid = np.arange(-BEFORE_TAP_S, AFTER_TAP_S, TAP_STEP_S)
    moved = np.stack([_around(time_s, readings, key + grid) for key in keys])
    from scipy.ndimage import gaussian_filter1d  # slow to load, and every service loads this file

    weights = _weights(moved)
    interval_s = float(np.median(np.diff(time_s)))
    smoothing = max(SMOOTHING_S, 0.5 * interval_s) / TAP_STEP_S
    speed = gaussian_filter1d(moved @ weights, smoothing, axis=1, order=1)
    speed = speed if _strike_rises(speed, grid) else -speed
    late, fits = _aligned(speed, grid)
    used = late[fits]
    if len(used) < FEWEST_TAPS:
        raise BadInput(
            f"only {len(used)} of {len(keys)} taps are alike; {FEWEST_TAPS} are needed. Strike the key fast,"
            " with one finger and the hand at rest, and lift the finger slowly"
        )
    draws = np.random.default_rng(seed).choice(used, (DRAWS, len(used)))
    order = np.argsort(-np.abs(weights * moved.std(axis=(0, 1))))
    key, key_sd = usual_key() if key_latency_s is None else (key_latency_s, 0.0)
    return TapLatency(
        float(np.median(used)) + key,
        float(np.hypot(np.median(draws, axis=1).std(), key_sd)),
        float(used.std(ddof=1)),
        len(key_s),
        len(used),
        tuple(sensors[int(place)] for place in order[:3]),
    )


def usual_key() -> tuple[float, float]:
    """Mean and standard deviation, seconds, of what a key takes to report a press."""
    low, high = USUAL_KEY_S
    return (low + high) / 2, (high - low) / np.sqrt(12.0)


def _usable(keys: np.ndarray, time_s: np.ndarray) -> np.ndarray:
    """Presses with frames all around them, and no other press near."""
    if len(time_s) < 2:
        return keys[:0]
    inside = (keys - BEFORE_TAP_S >= time_s[0]) & (keys + AFTER_TAP_S <= time_s[-1])
    gap = np.diff(keys, prepend=-np.inf, append=np.inf)
    return keys[inside & (gap[:-1] >= APART_S) & (gap[1:] >= APART_S)]


def _around(time_s: np.ndarray, readings: np.ndarray, at: np.ndarray) -> np.ndarray:
    """(M, S) readings at times (M,), from their mean."""
    values = np.column_stack([np.interp(at, time_s, column) for column in readings.T])
    return values - values.mean(axis=0)


def _weights(moved: np.ndarray) -> np.ndarray:
    """(S,) of the sensors in one signal: what taps share, over what they do not.

    Raises BadInput where nothing is shared.
    """
    mean = moved.mean(axis=0)
    own = (moved - mean).std(axis=(0, 1))
    shared = mean.std(axis=0)
    heard = shared > np.maximum(own, 1e-9) / np.sqrt(len(moved))
    if not heard.any() or not shared.any():
        raise BadInput("no sensor follows the taps; tap with a finger that the glove measures")
    quiet = np.maximum(own, 1e-3 * float(shared.max()))
    scaled = np.where(heard, mean / quiet, 0.0)
    _, _, directions = np.linalg.svd(scaled, full_matrices=False)
    return directions[0] / quiet


def _strike_rises(speed: np.ndarray, grid: np.ndarray) -> bool:
    """Whether the fastest stroke of the mean tap is upwards. Raises BadInput where both are as fast."""
    mean = np.median(speed, axis=0)[(grid >= EARLIEST_S) & (grid <= LATEST_S)]
    up, down = float(mean.max()), float(-mean.min())
    if max(up, down) < LEAST_CONTRAST * min(up, down):
        raise BadInput(
            "the finger is lifted as fast as it strikes, so that the strike cannot be told from the lift;"
            " strike the key fast and lift the finger slowly"
        )
    return up > down


def _aligned(speed: np.ndarray, grid: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(K,) how late each tap's stop is, seconds, and whether the tap is like the others."""
    shift, fits = np.zeros(len(speed)), np.ones(len(speed), dtype=bool)
    stop = correlation = np.zeros(0)
    for _ in range(ROUNDS):
        there = np.stack([np.interp(grid + late, grid, row) for late, row in zip(shift, speed, strict=True)])
        template = np.median(there[fits], axis=0)
        stop = _stop(template, grid)
        fitted = [_fitted(row, template, grid, stop, late) for row, late in zip(speed, shift, strict=True)]
        shift, correlation = (np.array(part) for part in zip(*fitted, strict=True))
        shift -= np.median(shift[fits])
        off = np.abs(shift - np.median(shift[fits]))
        spread = max(1.4826 * float(np.median(off[fits])), TAP_STEP_S)
        fits = (correlation >= LEAST_CORRELATION) & (off <= MOST_DEVIATIONS * spread)
        if fits.sum() < 3:
            break
    return stop + shift, fits


def _stop(template: np.ndarray, grid: np.ndarray) -> float:
    """Where the speed has fallen to half its peak, after the peak. Raises BadInput for none in reach."""
    within = (grid >= EARLIEST_S) & (grid <= LATEST_S)
    peak = int(np.argmax(np.where(within, template, -np.inf)))
    below = np.flatnonzero(template[peak:] < 0.5 * template[peak])
    if not len(below) or grid[peak + below[0]] > LATEST_S:
        raise BadInput(f"no stop of the finger is found within {LATEST_S} s after the key was pressed")
    at = peak + int(below[0])
    high, low = float(template[at - 1]), float(template[at])
    return float(grid[at - 1] + TAP_STEP_S * (high - 0.5 * template[peak]) / (high - low))


def _fitted(
    row: np.ndarray, template: np.ndarray, grid: np.ndarray, stop: float, near: float
) -> tuple[float, float]:
    """The shift (s) at which a tap is most like the template around its stop, and their correlation."""
    part = np.flatnonzero(np.abs(grid - stop) <= STROKE_S)
    shape = template[part] - template[part].mean()
    tried = near + np.arange(-ALIGNED_WITHIN_S, ALIGNED_WITHIN_S + TAP_STEP_S / 2, TAP_STEP_S)
    windows = np.interp(grid[part] + tried[:, None], grid, row)
    windows -= windows.mean(axis=1, keepdims=True)
    size = np.linalg.norm(windows, axis=1) * np.linalg.norm(shape)
    likeness = windows @ shape / np.maximum(size, 1e-12)
    best = int(np.argmax(likeness[1:-1])) + 1
    before, here, after = (float(value) for value in likeness[best - 1 : best + 2])
    bend = before - 2 * here + after
    between = float(np.clip(0.5 * (before - after) / bend, -0.5, 0.5)) if bend < 0 else 0.0
    return float(tried[best]) + TAP_STEP_S * between, here
