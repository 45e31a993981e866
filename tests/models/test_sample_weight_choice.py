"""How much a sample counts: errors that last are one error, and left-out takes have the last word."""

import numpy as np
import pytest

from glovecal_models.calibration.sample_weight import (
    Recorded,
    effective_sample_ratio,
    fit_weighted,
)
from glovecal_models.calibration.text import weight_sentence
from glovecal_models.errors import Cancelled
from glovecal_models.regression import profiled_likelihood
from glovecal_models.regression.fast_lmc import fit_lmc_gpr
from glovecal_models.regression.profiled_likelihood import cholesky


def lasting(count: int, memory: float, generator: np.random.Generator) -> np.ndarray:
    """First-order autoregressive errors of unit deviation; ``memory`` is the correlation of neighbours."""
    fresh = generator.normal(size=count)
    error = np.empty(count)
    error[0] = fresh[0]
    for frame in range(1, count):
        error[frame] = memory * error[frame - 1] + np.sqrt(1 - memory**2) * fresh[frame]
    return error


@pytest.mark.parametrize("memory", [0.0, 0.5, 0.9, 0.97])
def test_share_is_that_of_an_autoregressive_process(memory: float) -> None:
    """(1 - a) / (1 + a): the known integrated autocorrelation time of a first-order process."""
    generator = np.random.default_rng(1)
    takes = 20
    error = np.concatenate([lasting(1000, memory, generator) for _ in range(takes)])
    take = np.repeat(np.arange(takes), 1000)
    share = effective_sample_ratio(error, take, np.arange(len(error)))
    assert share == pytest.approx((1 - memory) / (1 + memory), rel=0.25)


def test_frames_held_five_times_count_a_fifth() -> None:
    fresh = np.random.default_rng(2).normal(size=2000)
    held = np.repeat(fresh, 5)
    one_take = np.zeros(len(held), dtype=int)
    assert effective_sample_ratio(held, one_take, np.arange(len(held))) == pytest.approx(0.2, rel=0.15)


def test_samples_far_apart_are_independent_though_neighbours_are_not() -> None:
    generator = np.random.default_rng(3)
    error, position = lasting(40_000, 0.9, generator), np.arange(40_000)
    one_take = np.zeros(len(error), dtype=int)
    assert effective_sample_ratio(error[::100], one_take[::100], position[::100]) > 0.8
    chosen = np.sort(generator.choice(len(error), 8000, replace=False))
    part = effective_sample_ratio(error[chosen], one_take[chosen], position[chosen])
    assert 1.5 * 0.053 < part < 0.5  # one in five: neighbours are five frames apart on average


def test_errors_do_not_last_from_one_take_to_the_next_and_no_error_is_no_trouble() -> None:
    take = np.repeat(np.arange(500), 2)
    error = np.tile([1.0, -1.0], 500)
    assert effective_sample_ratio(error, take, np.arange(1000)) == 1.0
    assert effective_sample_ratio(np.zeros(4), np.zeros(4, dtype=int), np.arange(4)) == 1.0
    assert effective_sample_ratio(np.ones(1), np.zeros(1, dtype=int), np.zeros(1, dtype=int)) == 1.0


def strides(hidden_degrees: float, seed: int) -> Recorded:
    """12 takes of periodic motion read by three sensors, and something lasting that no sensor reads."""
    generator = np.random.default_rng(seed)
    inputs, target = [], []
    for _ in range(12):
        phase = np.linspace(0, 2 * np.pi, 120) + generator.uniform(0, 6)
        wobble = np.column_stack([lasting(120, 0.97, generator) for _ in range(3)])
        motion = np.column_stack([np.sin(phase), np.cos(phase), np.sin(2 * phase)]) + 0.3 * wobble
        inputs.append(np.round(500 + 40 * motion, 1))
        hidden = hidden_degrees * lasting(120, 0.97, generator)
        target.append(15 * motion[:, 0] + 2 * motion[:, 1] ** 2 + hidden + generator.normal(0, 0.3, 120))
    take = np.repeat(np.arange(12), 120)
    return Recorded(np.concatenate(inputs), np.concatenate(target), take, np.arange(len(take)))


def error_on_others(regressor, hidden_degrees: float) -> float:
    others = strides(hidden_degrees, 99)
    return float(np.sqrt(np.mean((regressor.predict(others.inputs).mean - others.target) ** 2)))


def test_where_errors_last_samples_count_less_and_new_takes_are_predicted_better() -> None:
    samples = strides(4.0, 5)
    chosen = fit_weighted(samples)
    evidence = chosen.regressor.evidence
    assert chosen.weight < 1
    assert evidence["sample_weight"] == chosen.weight
    assert evidence["effective_sample_ratio"] < 0.5
    tried = evidence["held_out_rmse_deg"]
    assert tried[f"{chosen.weight:g}"] == min(tried.values()) < max(tried.values())
    sentence = weight_sentence("I_PIP", evidence)
    assert sentence is not None
    assert f"Samples weighted {chosen.weight:g}: smallest held-out error" in sentence
    believing = fit_lmc_gpr(samples.inputs, samples.target)
    assert error_on_others(chosen.regressor, 4.0) < 0.95 * error_on_others(believing, 4.0)


def test_many_short_takes_are_decided_with_a_quarter_of_the_work(monkeypatch: pytest.MonkeyPatch) -> None:
    """70 takes of four sensors: counted in Cholesky factorisations of all samples, which were 73 before."""
    generator = np.random.default_rng(2)
    inputs, target = [], []
    for _ in range(70):
        phase = np.linspace(0, 2 * np.pi, 28) + generator.uniform(0, 6)
        wobble = np.column_stack([lasting(28, 0.9, generator) for _ in range(4)])
        motion = np.column_stack([f(n * phase) for n in (1, 2) for f in (np.sin, np.cos)]) + 0.3 * wobble
        inputs.append(np.round(500 + 40 * motion, 1))
        hidden = 4.0 * lasting(28, 0.95, generator) + generator.normal(0, 0.3, 28)
        target.append(15 * motion[:, 0] + 2 * motion[:, 1] ** 2 + hidden)
    take = np.repeat(np.arange(70), 28)
    samples = Recorded(np.concatenate(inputs), np.concatenate(target), take, np.arange(len(take)))
    factored: list[int] = []

    def counted(matrix: np.ndarray) -> np.ndarray | None:
        factored.append(len(matrix))
        return cholesky(matrix)

    monkeypatch.setattr(profiled_likelihood, "cholesky", counted)
    chosen = fit_weighted(samples)
    assert chosen.weight < 1
    assert sum(size**3 for size in factored) < 25 * len(take) ** 3


def test_few_samples_that_are_worth_a_whole_one_count_as_such() -> None:
    """Single poses, far apart, of a curve with many bends: flexible, but every sample is news."""
    generator = np.random.default_rng(0)
    inputs = generator.uniform(0, 12, size=(60, 1))
    target = 20 * np.sin(inputs[:, 0]) + 8 * np.sin(5 * inputs[:, 0]) + generator.normal(0, 0.3, 60)
    poses = Recorded(inputs, target, np.arange(60), np.arange(60))
    chosen = fit_weighted(poses)
    assert chosen.weight == 1.0
    assert chosen.evidence["held_out_rmse_deg"]["1"] < 0.5 * chosen.evidence["held_out_rmse_deg"]["0.4"]
    plain = fit_lmc_gpr(inputs, target)
    assert np.array_equal(chosen.regressor.predict(inputs).mean, plain.predict(inputs).mean)


def test_where_errors_are_noise_every_sample_counts_and_nothing_is_tried() -> None:
    samples = strides(0.0, 5)
    chosen = fit_weighted(samples)
    assert chosen.weight == 1.0
    assert "held_out_rmse_deg" not in chosen.regressor.evidence
    assert weight_sentence("I_PIP", chosen.regressor.evidence) is None
    plain = fit_lmc_gpr(samples.inputs, samples.target)
    assert np.array_equal(chosen.regressor.predict(samples.inputs).mean, plain.predict(samples.inputs).mean)


def test_too_little_to_leave_takes_out_trains_all_the_same() -> None:
    generator = np.random.default_rng(0)
    inputs = generator.normal(size=(12, 1))
    few = Recorded(inputs, lasting(12, 0.9, generator), np.zeros(12, dtype=int), np.arange(12))
    assert np.isfinite(fit_weighted(few).regressor.predict(inputs).mean).all()


def test_cancelled_while_weights_are_tried() -> None:
    samples, asked = strides(4.0, 5), []
    fit_lmc_gpr(samples.inputs, samples.target, cancelled=lambda: bool(asked.append(1)))
    before = len(asked)
    asked.clear()

    def after_the_first_fit() -> bool:
        asked.append(1)
        return len(asked) > before

    with pytest.raises(Cancelled):
        fit_weighted(samples, cancelled=after_the_first_fit)
