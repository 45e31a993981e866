"""Which step teaches most for its time, and when enough is known."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from glovecal_models.errors import BadInput
from glovecal_models.layout import Correspondence, Layout
from glovecal_models.regression.process_regressor import ProcessRegressor
from glovecal_models.sampling.active.assumed_process import (
    AssumedProcess,
    PosteriorVariance,
    SampledPoints,
    assumed_process,
    rotation_range_deg,
    sampled_points,
    step_errors,
)
from glovecal_models.sampling.active.known_readings import (
    ALIKE_FRAMES,
    ExpectedReadings,
    KnownReadings,
    shared_sd_deg,
)
from glovecal_models.sampling.limits import SAMPLING_LIMITS, SamplingLimits
from glovecal_models.sampling.protocol import Step, step_capture_s

USUAL_RATE_HZ = 60.0


@dataclass(frozen=True)
class ProposedStep:
    step: Step
    seconds: float
    """Capture time with countdown and settling."""
    sd_after_deg: Mapping[str, float]
    """Expected standard deviation of each rotation that it teaches something of."""
    rms_after_deg: float
    """Over all rotations."""
    error_fall_deg: float
    """By how much the expected error of a frame, noise included, falls."""

    @property
    def fall_per_s(self) -> float:
        return self.error_fall_deg / self.seconds


@dataclass(frozen=True)
class Proposal:
    ranked: tuple[ProposedStep, ...]
    """The one that teaches most for its time first."""
    sd_deg: Mapping[str, float]
    """Root mean variance of each rotation over free motion now, noise left out."""
    noise_deg: Mapping[str, float]
    learned: tuple[str, ...]
    """Rotations whose process comes from a trained model; the others' is assumed."""
    sentences: tuple[str, ...] = field(default=())
    limits: SamplingLimits = SAMPLING_LIMITS

    @property
    def rms_deg(self) -> float:
        return float(np.sqrt(np.mean(np.square(list(self.sd_deg.values())))))

    @property
    def is_enough(self) -> bool:
        return not self.ranked or max(each.error_fall_deg for each in self.ranked) < self.limits.enough_deg

    def to_document(self, most: int = 10) -> dict[str, Any]:
        return {
            "rms_sd_deg": _rounded(self.rms_deg),
            "sd_deg": {name: _rounded(deg) for name, deg in self.sd_deg.items()},
            "noise_deg": {name: _rounded(deg) for name, deg in self.noise_deg.items()},
            "enough": self.is_enough,
            "steps": [_step_document(each, self) for each in self.ranked[:most]],
            "assumed": [name for name in self.sd_deg if name not in self.learned],
            "sentences": [*self.sentences, self.verdict()],
        }

    def verdict(self) -> str:
        if not self.ranked:
            return "No pose or motion that could be asked for teaches any of this glove's rotations."
        best = self.ranked[0]
        if self.is_enough:
            return (
                f"Enough: the next step, {best.step.name}, would lower the expected error by less than "
                f"{self.limits.enough_deg:g} degrees. {self._left()}"
            )
        return f"Next: {best.step.name}. {gain_sentence(best, self)}"

    def _left(self) -> str:
        noise = float(np.sqrt(np.mean(np.square(list(self.noise_deg.values())))))
        if self.rms_deg <= noise:
            return f"What is left, {self.rms_deg:.1f} degrees, is below a frame's noise of {noise:.1f}."
        return (
            f"{self.rms_deg:.1f} degrees are left (a frame's noise: {noise:.1f}); more of these steps hardly "
            "lower them."
        )


def gain_sentence(best: ProposedStep, proposal: Proposal) -> str:
    """What is expected of a step, in degrees."""
    falls = sorted(best.sd_after_deg, key=lambda name: best.sd_after_deg[name] - proposal.sd_deg[name])[:4]
    told = ", ".join(f"{name} {proposal.sd_deg[name]:.1f} to {best.sd_after_deg[name]:.1f}" for name in falls)
    return (
        f"Expected standard deviation in degrees: {told}; over all rotations "
        f"{proposal.rms_deg:.2f} to {best.rms_after_deg:.2f}, in {best.seconds:.1f} s."
    )


def propose(
    layout: Layout,
    known: KnownReadings,
    candidates: Sequence[Step],
    *,
    trained: Mapping[str, ProcessRegressor] | None = None,
    limits: SamplingLimits = SAMPLING_LIMITS,
) -> Proposal:
    """Rank ``candidates`` by the expected fall of the error per second.

    ``trained`` has the processes by rotation that a current model holds. Raises BadInput where no candidate
    and no known reading says anything of any rotation.
    """
    informed = {rotation for step in candidates for rotation in step.angles}
    informed |= {rotation for block in known.blocks for rotation in block.angles}
    wanted = [item for item in layout.correspondences if item.simulated is None and item.rotation in informed]
    if not wanted:
        raise BadInput(f"layout {layout.name!r}: no pose or widget is known for any of its rotations")
    expected = ExpectedReadings(known, wanted)
    states = {item.rotation: _state(item, known, trained or {}) for item in wanted}
    now = {name: float(state.variance.mean()) for name, (_, state) in states.items()}
    noise = {name: process.noise_sd_deg for name, (process, _) in states.items()}
    ranked = []
    for step in candidates:
        after = dict(now)
        for item in wanted:
            if item.rotation in step.angles:
                fall = _fall(step, item, *states[item.rotation], expected)
                after[item.rotation] = max(now[item.rotation] - fall, 0.0)
        ranked.append(_proposed(step, now, after, noise))
    ranked.sort(key=lambda each: -each.fall_per_s)
    learned = tuple(name for name, (process, _) in states.items() if process.learned)
    return Proposal(tuple(ranked), _told_sd_deg(now), noise, learned, limits=limits)


def _state(
    item: Correspondence, known: KnownReadings, trained: Mapping[str, ProcessRegressor]
) -> tuple[AssumedProcess, PosteriorVariance]:
    process = assumed_process(item, known.low, known.high, known.sensors, trained.get(item.rotation))
    u = process.unit(item.input_columns(known.free, known.sensors))
    sampled = [sampled_points(block, item, process, known.sensors) for block in known.blocks]
    return process, PosteriorVariance(process, u, [each for each in sampled if len(each.points)])


def _fall(
    step: Step,
    item: Correspondence,
    process: AssumedProcess,
    state: PosteriorVariance,
    expected: ExpectedReadings,
) -> float:
    """Of the rotation's mean variance, degrees squared."""
    points = process.unit(expected.of(step, item))
    samples = step.seconds * USUAL_RATE_HZ / ALIKE_FRAMES
    errors = step_errors(len(points), samples, process.noise_sd_deg, shared_sd_deg(step))
    return float(state.fall(SampledPoints(points, errors)).mean())


def _proposed(
    step: Step, now: Mapping[str, float], after: Mapping[str, float], noise: Mapping[str, float]
) -> ProposedStep:
    frame = float(np.mean(np.square(list(noise.values()))))
    before_all, after_all = (float(np.mean(list(each.values()))) for each in (now, after))
    told = _told_sd_deg(after)
    return ProposedStep(
        step,
        step_capture_s(step),
        {name: told[name] for name in step.angles if name in told},
        float(np.sqrt(np.mean(np.square(list(told.values()))))),
        float(np.sqrt(before_all + frame) - np.sqrt(after_all + frame)),
    )


def _told_sd_deg(variance: Mapping[str, float]) -> dict[str, float]:
    """What is left to know of an angle that lies within its range anyway: precisions add."""
    told = {}
    for name, value in variance.items():
        in_range = rotation_range_deg(name) ** 2 / 12
        told[name] = float(np.sqrt(value * in_range / (value + in_range)))
    return told


def _step_document(each: ProposedStep, proposal: Proposal) -> dict[str, Any]:
    return {
        "name": each.step.name,
        "ask": each.step.ask,
        "needs": each.step.needs,
        "seconds": _rounded(each.seconds),
        "angles": dict(each.step.angles),
        "sd_deg": {name: _rounded(proposal.sd_deg[name]) for name in each.sd_after_deg},
        "sd_after_deg": {name: _rounded(deg) for name, deg in each.sd_after_deg.items()},
        "rms_sd_after_deg": _rounded(each.rms_after_deg),
        "error_fall_deg": float(f"{each.error_fall_deg:.3g}"),
        "sentence": gain_sentence(each, proposal),
    }


def _rounded(value: float) -> float:
    return round(value, 3)
