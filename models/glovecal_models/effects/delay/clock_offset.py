"""Clock offset: the reference system's clock and the glove's do not agree, in each take by its own amount.

A reference-side effect: it is repaired in the measurement, not predicted. The offset comes from the clock
scan; a drift is added in takes of a minute or more where it pays, and an offset that changes within a take is
followed. In a take that training never saw it is where the reference is nearest to what the model predicts.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from glovecal_models.effects.base.assessment import Assessment
from glovecal_models.effects.base.comparison import Problem
from glovecal_models.effects.base.effect import RepairByPrediction, RepairEffect
from glovecal_models.effects.base.facts import About, Parameter, Shape
from glovecal_models.effects.base.findings import Finding, Proposal, Recorded, check_signature_input
from glovecal_models.effects.base.relations import FAST
from glovecal_models.effects.base.signals import Settings
from glovecal_models.effects.delay.clock_wander import clock_wander, without_wander
from glovecal_models.effects.delay.delay_comparison import (
    ShiftComparison,
    is_one_latency,
    large_latency_s,
    large_offsets,
)
from glovecal_models.effects.delay.delay_grid import DelayErrors
from glovecal_models.effects.delay.delay_verdict import (
    CLOCK,
    LATENCY,
    ClockChoice,
    clock_choice,
    if_the_glove_is_late,
)
from glovecal_models.takes.clock_scan import (
    FINE_S,
    RANGE_S,
    WORTHWHILE,
    ClockOffset,
    Grid,
    aligned,
    clock_offsets,
    on_grid,
    unexplained,
    without_reference,
)
from glovecal_models.takes.take import Take

# Clock drift: the reference clock runs faster or slower than the glove's, seen in takes of a minute or
# more. Reference time = frame time + offset + drift x (frame time - middle of the take). Searched coarsely
# over the drift, then polished together with the offset, by the same measure as the offset alone: what a
# linear map of the sensors leaves unexplained. It counts only when it pays and when the first and the last
# third of the take, each by itself, want offsets that differ accordingly.


SHORTEST_DRIFT_S = 60.0
LARGEST_PPM = 2000.0
END_STEP_S = 0.02
"""Between neighbouring drifts of the search, at either end of the take."""
LEAST_SHIFT_S = 0.01
"""Less from end to end is not worth a repair."""
THIRDS_WITHIN_S = 0.15
AGREE_WITHIN = 0.5


@dataclass(frozen=True)
class ClockDrift:
    """A take's clock with a drift that pays."""

    take: str
    offset_s: float
    """In the middle of the take."""
    drift_ppm: float
    middle_s: float
    """Frame time at which the offset holds."""
    unexplained_before: float
    """Share of the reference's variance that a linear map leaves with the offset alone."""
    unexplained_after: float

    @property
    def sentence(self) -> str:
        faster = "faster" if self.drift_ppm > 0 else "slower"
        return (
            f"Take {self.take}: the reference clock runs {abs(self.drift_ppm):.0f} ppm {faster} than the "
            f"glove's, with an offset of {self.offset_s:+.3f} s in the middle of the take."
        )


def clock_drift(take: Take, offset_s: float) -> ClockDrift | None:
    """The drift about a known offset, or None when the take is too short or a drift does not pay."""
    grid = on_grid(take)
    if grid is None or take.duration_s < SHORTEST_DRIFT_S:
        return None
    middle = float(grid.time_s.mean())
    half = take.duration_s / 2.0

    def left(offset: float, end_shift: float) -> float:
        at = grid.time_s + offset + end_shift / half * (grid.time_s - middle)
        share = unexplained(grid, grid.readings, at)
        return share if np.isfinite(share) else 1.0

    steps = int(np.ceil(LARGEST_PPM * 1e-6 * half / END_STEP_S))
    coarse = END_STEP_S * np.arange(-steps, steps + 1)
    start = float(coarse[int(np.argmin([left(offset_s, shift) for shift in coarse]))])
    without = _polished_offset(left, offset_s)
    from scipy.optimize import minimize  # slow to load, and each service loads all effects

    simplex = [(offset_s, start), (offset_s + END_STEP_S, start), (offset_s, start + END_STEP_S)]
    best = minimize(
        lambda pair: left(*pair), (offset_s, start), method="Nelder-Mead",
        options={"initial_simplex": simplex, "xatol": 5e-4, "fatol": 1e-9, "maxfev": 120},
    )  # fmt: skip
    offset, end_shift = (float(value) for value in best.x)
    before, after = left(without, 0.0), float(best.fun)
    if after > WORTHWHILE * before or abs(end_shift) < LEAST_SHIFT_S / 2.0:
        return None
    drift = end_shift / half
    if abs(drift) > LARGEST_PPM * 1e-6 or not _thirds_agree(grid, offset, drift, middle):
        return None
    return ClockDrift(take.name, offset, 1e6 * drift, middle, before, after)


def without_drift(take: Take, clock: ClockDrift) -> Take:
    """The take with its reference on the frames' clock."""
    drift = clock.drift_ppm * 1e-6
    time = (take.reference_time_s - clock.offset_s + drift * clock.middle_s) / (1.0 + drift)
    return replace(take, reference_time_s=time)


def _polished_offset(left: Callable[[float, float], float], offset_s: float) -> float:
    offsets = offset_s + FINE_S * np.arange(-8, 9)
    return float(offsets[int(np.argmin([left(offset, 0.0) for offset in offsets]))])


def _thirds_agree(grid: Grid, offset_s: float, drift: float, middle_s: float) -> bool:
    """Whether the first and the last third want offsets that differ as the drift says."""
    third = len(grid.time_s) // 3
    wanted, centres = [], []
    for part in (slice(0, third), slice(-third, None)):
        piece = replace(grid, time_s=grid.time_s[part], readings=grid.readings[part])
        centre = float(piece.time_s.mean())
        offsets = offset_s + np.arange(-THIRDS_WITHIN_S, THIRDS_WITHIN_S + FINE_S, FINE_S)
        offsets = offsets + drift * (centre - middle_s)
        shares = [unexplained(piece, piece.readings, piece.time_s + offset) for offset in offsets]
        if not np.isfinite(shares).any():
            return False
        wanted.append(float(offsets[int(np.nanargmin(shares))]))
        centres.append(centre)
    measured = (wanted[1] - wanted[0]) / (centres[1] - centres[0])
    return abs(measured - drift) <= AGREE_WITHIN * abs(drift)


TO_MODEL_COARSE_S, TO_MODEL_FINE_S = 0.04, 0.002
LEAST_OVERLAP = 0.6
"""Of the frames that the reference can cover."""


def offset_to(take: Take, rotations: Sequence[str], predicted: np.ndarray, width_s: float) -> float:
    """Seconds, at most ``width_s`` from zero, for the model's angles (N, R) at the frames, degrees."""
    columns = [(take.rotations.index(name), i) for i, name in enumerate(rotations) if name in take.rotations]
    scale = np.maximum(np.nanstd(take.reference, axis=0), 1.0)

    measured_s = float(take.reference_time_s[-1] - take.reference_time_s[0])
    least = LEAST_OVERLAP * min(1.0, measured_s / max(take.duration_s, 1e-9))

    def misfit(offset_s: float) -> float:
        at = take.time_s + offset_s
        inside = (at >= take.reference_time_s[0]) & (at <= take.reference_time_s[-1])
        if inside.mean() < least:
            return np.inf
        total = []
        for column, row in columns:
            known = np.isfinite(take.reference[:, column])
            if known.sum() > 1:
                values = np.interp(at[inside], take.reference_time_s[known], take.reference[known, column])
                total.append(np.mean((values - predicted[inside, row]) ** 2) / scale[column] ** 2)
        return float(np.mean(total)) if total else np.inf

    coarse = np.arange(-width_s, width_s + TO_MODEL_COARSE_S / 2, TO_MODEL_COARSE_S)
    best = float(coarse[int(np.argmin([misfit(offset) for offset in coarse]))])
    fine = np.arange(
        best - TO_MODEL_COARSE_S, best + TO_MODEL_COARSE_S + TO_MODEL_FINE_S / 2, TO_MODEL_FINE_S
    )
    return float(fine[int(np.argmin([misfit(offset) for offset in fine]))])


NEAR_S = 0.3
"""When training's offsets all lie within this, so will another take's."""


@dataclass(frozen=True)
class TakeClock:
    """One take's clock: the scan's answer, and a drift where one pays."""

    scan: ClockOffset
    drift: ClockDrift | None

    @property
    def offset_s(self) -> float:
        return self.drift.offset_s if self.drift else self.scan.offset_s

    @property
    def drift_ppm(self) -> float:
        return self.drift.drift_ppm if self.drift else 0.0

    def repaired(self, take: Take) -> Take:
        """The take with its reference on the frames' clock; the same object when the clocks agree."""
        if self.drift is not None:
            return without_drift(take, self.drift)
        return aligned(take, self.scan.offset_s) if self.scan.verdict == "offset" else take


class ClockComparison(ShiftComparison):
    def choice(self, grids: Sequence[DelayErrors], problem: Problem) -> ClockChoice:
        """One offset for all joints and, where that pays, one for each take."""
        return clock_choice(grids, problem.limits)

    def consequence(self, found: Assessment, confidence_set: Sequence[str]) -> str:
        late = super().consequence(found, confidence_set)
        return f"{offsets_sentence(-found.shapes[0])} {late}".rstrip()

    def constants(self, found: Assessment, takes: Sequence[str]) -> Settings | None:
        """None when the clocks agree."""
        if not found.shapes[0].any():
            return None
        offsets = -np.broadcast_to(found.shapes[0], (len(takes),))
        return {
            "offset_s": dict(zip(takes, map(float, offsets), strict=True)),
            "common_s": float(np.median(offsets)),
            "per_take": bool(np.ptp(offsets) > 0),
            "within_takes": True,
        }


class ClockOffsetEffect(RepairEffect, RepairByPrediction):
    name = CLOCK
    about = About(
        "Glove and reference system were recorded with clocks that disagree.",
        source="two recorders without a common clock; real ankle recordings: -2.0 to 0.6 s, each take its"
        " own",
        shown_over="clock shift",
        shown_by=FAST,
    )
    shape = Shape(
        (
            Parameter("offset", "s", -RANGE_S, RANGE_S, "some tenths of a second, each take its own"),
            Parameter("drift", "ppm", -LARGEST_PPM, LARGEST_PPM, "below 100 ppm for two good clocks"),
        )
    )
    comparison = ClockComparison(effect=CLOCK, number="offset_s")

    @property
    def by_prediction(self) -> RepairByPrediction:
        return self

    def proposed(self, recorded: Recorded) -> Proposal | None:
        """Large offsets, each take its own; None unless most takes that can be judged have one."""
        if large_latency_s(recorded.takes) is not None:
            return None
        found = clock_offsets(recorded.takes)
        offsets = large_offsets(found)
        if not offsets:
            return None
        common = float(np.median(list(offsets.values())))
        each = {item.take: _offset_of(item, common) for item in found if not item.is_unknown}
        unknown = [item.take for item in found if item.is_unknown]
        settings: Settings = {"offset_s": each, "common_s": common, "per_take": True, "within_takes": True}
        if unknown:
            settings["left_out"] = unknown
        sentences = [offsets_sentence(list(each.values())), *map(_left_out_sentence, unknown)]
        if recorded.takes[0].glove_latency is not None or not is_one_latency(found):
            return Proposal(settings, None, tuple(sentences))
        both = (self.name, LATENCY)
        return Proposal(settings, None, (*sentences, if_the_glove_is_late(-common, both)), both)

    def described(self, settings: Settings) -> dict[str, Any]:
        offset = settings["offset_s"] if settings["per_take"] else settings["common_s"]
        left_out = settings.get("left_out", [])
        return {"offset_s": offset, **({"left_out": left_out} if left_out else {})}

    def clocks(self, takes: Sequence[Take], *, drift: bool = True) -> tuple[TakeClock, ...]:
        """One answer per take, in their order; takes of one wearing are judged together."""
        return tuple(
            TakeClock(scan, _drift(take, scan) if drift else None)
            for take, scan in zip(takes, clock_offsets(takes), strict=True)
        )

    def find(
        self,
        takes: Sequence[Take],
        sensor_of: Mapping[str, str],
        errors: Sequence[np.ndarray] | None = None,
    ) -> tuple[Finding, ...]:
        check_signature_input(takes, sensor_of, errors)
        found = [_finding(clock) for clock in self.clocks(takes)]
        known = [item for item in found if item is not None]
        return tuple(sorted(known, key=lambda item: -abs(item.evidence["offset_s"])))

    def repaired(self, takes: Sequence[Take], settings: Settings | None = None) -> tuple[Take, ...]:
        if settings is None:
            return tuple(clock.repaired(take) for take, clock in zip(takes, self.clocks(takes), strict=True))
        offsets, common = settings["offset_s"], float(settings["common_s"])
        left_out = set(settings.get("left_out", ()))
        moved = tuple(
            without_reference(take)
            if take.name in left_out
            else aligned(take, float(offsets.get(take.name, common)))
            for take in takes
        )
        return without_wander(moved) if settings.get("within_takes") else moved

    def repaired_to(
        self, take: Take, settings: Settings, rotations: Sequence[str], predicted: np.ndarray
    ) -> Take:
        """A common offset found in training is applied as it is; where each take had its own, that of a take
        training never saw is where its reference fits the prediction best."""
        if len(take.reference_time_s) < 2:
            return take
        moved = self._moved_to(take, settings, rotations, predicted)
        wander = clock_wander(moved, rotations, predicted) if settings.get("within_takes") else None
        return moved if wander is None else wander.removed(moved)

    def _moved_to(
        self, take: Take, settings: Settings, rotations: Sequence[str], predicted: np.ndarray
    ) -> Take:
        offsets = {str(name): float(value) for name, value in settings["offset_s"].items()}
        if not settings["per_take"]:
            return aligned(take, float(settings["common_s"]))
        if take.name in offsets:
            return aligned(take, offsets[take.name])
        largest = max((abs(value) for value in offsets.values()), default=NEAR_S)
        width = NEAR_S if largest < 0.5 * NEAR_S else RANGE_S
        return aligned(take, offset_to(take, rotations, predicted, width))


def offsets_sentence(offsets_s: Sequence[float] | np.ndarray) -> str:
    """How far the reference clock is off, in seconds."""
    offsets = np.asarray(offsets_s, dtype=float)
    low, high, middle = float(offsets.min()), float(offsets.max()), float(np.median(offsets))
    if high - low < TO_MODEL_FINE_S:
        return f"Offset of the reference clock: {middle:+.3f} s."
    return (
        f"Offset of the reference clock: {low:+.3f} to {high:+.3f} s, median {middle:+.3f} s, each of"
        f" {len(offsets)} takes its own."
    )


def _offset_of(scan: ClockOffset, common_s: float) -> float:
    """Of a take without movement the offset does not matter much."""
    return scan.offset_s if scan.verdict in ("offset", "agrees") else common_s


def _left_out_sentence(take: str) -> str:
    return f"The reference of take {take} is left out: its clock offset was not found within ±{RANGE_S:g} s."


def _drift(take: Take, scan: ClockOffset) -> ClockDrift | None:
    return clock_drift(take, scan.offset_s) if scan.verdict in ("offset", "agrees") else None


def _finding(clock: TakeClock) -> Finding | None:
    scan, drift = clock.scan, clock.drift
    if drift is None and scan.verdict not in ("offset", "range too small"):
        return None
    evidence = {
        "offset_s": clock.offset_s,
        "drift_ppm": clock.drift_ppm,
        "unexplained_before_pct": 100.0 * scan.unexplained_before,
        "unexplained_after_pct": 100.0 * (drift.unexplained_after if drift else scan.unexplained_after),
        "unexplained_reversed_pct": 100.0 * scan.unexplained_reversed,
    }
    return Finding(
        ClockOffsetEffect.name, (scan.take,), drift.sentence if drift else scan.sentence,
        kind="drift" if drift else scan.verdict, evidence=evidence,
    )  # fmt: skip
