"""Whatever finite takes hold, a diagnosis and an improvement end in sentences or in a refusal."""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import suppress
from dataclasses import astuple, dataclass

import numpy as np
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st
from scipy.signal import lfilter

from glovecal_models.calibration.training_settings import TrainingSettings
from glovecal_models.diagnosis.diagnose import diagnose
from glovecal_models.diagnosis.text import diagnosis_sentences
from glovecal_models.errors import BadInput
from glovecal_models.improvement.improve import improve
from glovecal_models.improvement.text import improvement_sentences
from glovecal_models.layout import Layout
from glovecal_models.takes.take import Take

NAMES = ("A", "B", "C")
KINDS = ("moves", "wanders", "still", "still but once", "steps", "same as A", "exact line")
SHAPES = settings(
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large],
    phases=(Phase.explicit, Phase.generate),
)


@dataclass(frozen=True)
class AnyTakes:
    """Takes of two rotations and three sensors, made from what hypothesis chose."""

    seed: int
    frames: list[int]
    rate_hz: float
    columns: list[str]
    """Of the three sensors, then of the two rotations."""
    reading_scale: float
    angle_scale: float
    noise: float
    measured: list[str]
    """For each take: which of its references there are."""
    wearings: int
    memory: float

    def takes(self) -> list[Take]:
        random = np.random.default_rng(self.seed)
        return [self._take(random, number, count) for number, count in enumerate(self.frames)]

    def _take(self, random: np.random.Generator, number: int, count: int) -> Take:
        time = np.arange(count) / self.rate_hz
        first = self._column(random, self.columns[0], time, None)
        columns = [first, *(self._column(random, kind, time, first) for kind in self.columns[1:])]
        readings = np.column_stack(columns[:3]) * self.reading_scale
        reference = np.column_stack(columns[3:]) * self.angle_scale
        which = self.measured[number % len(self.measured)]
        if which == "none":
            reference = np.empty((0, 0))
        elif which == "some":
            reference[random.random(reference.shape) < 0.5] = np.nan
        elif which == "one":
            reference[:, 1] = np.nan
        rotations = () if which == "none" else NAMES[:2]
        return Take(
            f"t{number}", f"w{number % self.wearings}", NAMES, time, readings, rotations,
            time if rotations else np.empty(0), reference,
        )  # fmt: skip

    def _column(
        self, random: np.random.Generator, kind: str, time: np.ndarray, first: np.ndarray | None
    ) -> np.ndarray:
        noise = self.noise * np.asarray(lfilter([1.0], [1.0, -self.memory], random.normal(size=len(time))))
        if first is not None and kind == "same as A":
            return first + noise
        if first is not None and kind == "exact line":
            return 2.0 * first + 1.0
        if kind == "still":
            return np.full(len(time), 7.0)
        if kind == "still but once":
            return np.where(np.arange(len(time)) == len(time) // 2, 8.0, 7.0)
        if kind == "steps":
            return np.round(2 * np.sin(time)) + 5.0
        if kind == "wanders":
            return np.cumsum(random.normal(size=len(time)))
        return 40 * np.sin(2 * time * random.uniform(0.5, 1.5)) + noise


def any_takes(most_frames: int) -> st.SearchStrategy[AnyTakes]:
    return st.builds(
        AnyTakes,
        seed=st.integers(0, 2**16),
        frames=st.lists(st.integers(1, most_frames), min_size=1, max_size=4),
        rate_hz=st.sampled_from([1.0, 9.0, 60.0]),
        columns=st.lists(st.sampled_from(KINDS), min_size=5, max_size=5),
        reading_scale=st.sampled_from([1.0, 1e-12, 1e12]),
        angle_scale=st.sampled_from([1.0, 1e-9, 1e4]),
        noise=st.sampled_from([0.0, 1e-6, 1.0]),
        measured=st.lists(st.sampled_from(["all", "all", "some", "one", "none"]), min_size=1, max_size=3),
        wearings=st.sampled_from([1, 2]),
        memory=st.sampled_from([0.0, 0.99]),
    )


LAYOUT = Layout.from_columns("any", NAMES, NAMES[:2])


def is_finite(numbers: Iterable[float | None]) -> bool:
    return all(number is None or np.isfinite(number) for number in numbers)


@given(any_takes(400))
@settings(SHAPES, max_examples=25)
def test_a_diagnosis_ends_in_sentences_and_finite_errors(found: AnyTakes):
    with suppress(BadInput):
        diagnosis = diagnose(found.takes(), LAYOUT)
        assert diagnosis_sentences(diagnosis)
        assert is_finite(diagnosis.rmse_deg.values())
        assert is_finite(value for item in diagnosis.assessments for value in astuple(item.rmse_deg))
        for each in (*diagnosis.residual.slow.values(), *diagnosis.residual.within_takes.values()):
            assert 0 <= each.lower_bound_deg <= each.size_deg


@given(any_takes(150))
@settings(SHAPES, max_examples=6)
def test_an_improvement_ends_in_sentences_and_finite_errors(found: AnyTakes):
    with suppress(BadInput):
        improvement = improve(found.takes(), LAYOUT, "anna", TrainingSettings(method="linear", samples=60))
        assert improvement_sentences(improvement)
        assert is_finite(step.rmse_deg for step in improvement.steps)
