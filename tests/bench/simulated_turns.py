"""How many frames processes of a given speed predict, and how old the poses are: their turns, simulated.

The turns are those of ``glovecal_service.realtime.pose_loop``: models take turns, a turn has the newest
frames of the model's gloves, and what waited too long is skipped. Gloves are shared out as the service does
it.
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass

import numpy as np

from glovecal_service.incoming.glove_owners import owner_of
from glovecal_service.realtime.pose_loop import OLDEST_NS, ROUND_BUDGET_S

OLDEST_S = OLDEST_NS / 1e9


@dataclass(frozen=True)
class Cost:
    """Seconds of one core."""

    turn_s: float
    """Whatever is in it."""
    frame_s: float
    """More for each frame."""

    def of(self, frames: int) -> float:
        return self.turn_s + frames * self.frame_s

    def frames_within(self, seconds: float) -> int:
        return max(1, int((seconds - self.turn_s) / self.frame_s))


@dataclass(frozen=True)
class Outcome:
    share: float
    """Of the frames that were predicted."""
    p99_ms: float
    """Age of the poses."""


def simulate(
    gloves: int, gloves_a_model: int, cost: Cost, *, processes: int = 1, rate_hz: float = 120.0,
    seconds: float = 5.0, seed: int = 0,
) -> Outcome:  # fmt: skip
    """Of all processes together, each with a core of its own."""
    instances = [f"realtime-{number:08x}" for number in range(processes)]
    owned: defaultdict[str, list[int]] = defaultdict(list)
    for glove in range(gloves):
        owned[owner_of(f"glove{glove}", instances)].append(glove)
    random = np.random.default_rng(seed)
    ages = [
        _one_process(np.array(own), gloves_a_model, cost, rate_hz, seconds, random) for own in owned.values()
    ]
    predicted = np.concatenate(ages)
    p99_s = float(np.quantile(predicted, 0.99)) if len(predicted) else float("nan")
    return Outcome(len(predicted) / (gloves * round(rate_hz * seconds)), 1e3 * p99_s)


def _one_process(
    gloves: np.ndarray, gloves_a_model: int, cost: Cost, rate_hz: float, seconds: float,
    random: np.random.Generator,
) -> np.ndarray:  # fmt: skip
    """Ages of the poses, seconds."""
    each = round(rate_hz * seconds)
    times = (np.arange(each)[:, None] + random.uniform(0, 1, len(gloves))).ravel() / rate_hz
    order = np.argsort(times, kind="stable")
    arrivals = list(zip(times[order].tolist(), np.tile(gloves, each)[order].tolist(), strict=True))
    pending: dict[int, dict[int, list[float]]] = {}
    ages: list[float] = []
    now, next_one = 0.0, 0
    while next_one < len(arrivals) or pending:
        if not pending:
            now = max(now, arrivals[next_one][0])
        while next_one < len(arrivals) and arrivals[next_one][0] <= now:
            at, glove = arrivals[next_one]
            pending.setdefault(glove // gloves_a_model, {}).setdefault(glove, []).append(at)
            next_one += 1
        waiting = sum(map(len, pending.values()))
        lanes = pending.pop(next(iter(pending)))
        within = cost.frames_within(ROUND_BUDGET_S * len(lanes) / waiting)
        limit = max(1, within // len(lanes))
        taken = [at for lane in lanes.values() for at in lane[-limit:] if now - at <= OLDEST_S]
        now += cost.of(len(taken))
        ages += [now - at for at in taken]
    return np.array(ages)
