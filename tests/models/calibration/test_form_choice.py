"""Which form the takes ask for: none where the effect's own columns are enough, the right one elsewhere."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from glovecal_models.calibration.form_choice import FormRows, chosen_form
from glovecal_models.calibration.held_out import Rows, weight_posterior
from glovecal_models.effects.base.learned_form import OWN, FormTerm, LearnedForm

Law = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]
NOISE = 0.5
WIDEST = 4.5
"""Standard deviations of the motion."""


def motion(random: np.random.Generator, count: int) -> np.ndarray:
    """(N,) smooth, about -2 to 2."""
    steps = random.standard_normal(count + 400)
    kernel = np.exp(-0.5 * (np.arange(-100, 101) / 15.0) ** 2)
    values = np.convolve(steps, kernel, mode="same")[200:-200]
    return values / values.std()


def rows(law: Law, seed: int = 0, count: int = 4000, others: int = 4) -> FormRows:
    random = np.random.default_rng(seed)
    own = motion(random, count)
    neighbours = [motion(random, count) for _ in range(others)]
    target = 20 * own + law(neighbours[0], neighbours[1], own) + NOISE * random.standard_normal(count)
    plain = np.column_stack([*neighbours, *(each * own for each in neighbours)])
    inputs = {f"n{place}": each[:, None] for place, each in enumerate(neighbours)} | {OWN: own[:, None]}
    free = np.polynomial.legendre.legvander(own / WIDEST, 7)
    return FormRows(free, plain, np.full(2 * others, 3.0), inputs, target)


def test_own_columns_that_are_enough_get_no_form() -> None:
    for seed in range(5):
        assert chosen_form([rows(lambda a, b, own: 2 * a, seed)]) == ()
        assert chosen_form([rows(lambda a, b, own: 0 * a, seed)]) == ()
        assert chosen_form([rows(lambda a, b, own: 1.5 * a * own - b, seed)]) == ()


@pytest.mark.parametrize(
    ("law", "inputs"),
    [
        (lambda a, b, own: 3 * np.maximum(a, 0.0), {"n0"}),
        (lambda a, b, own: 3 * np.tanh(3 * a), {"n0"}),
        (lambda a, b, own: 3 * np.sin(4 * a), {"n0"}),
        (lambda a, b, own: 2 * np.maximum(a, 0.0) * np.maximum(own, 0.0), {"n0"}),
        (
            lambda a, b, own: 3 * np.maximum(a, 0.0) + 3 * np.maximum(a, 0.0) * np.maximum(b, 0.0),
            {"n0", "n1"},
        ),
        (lambda a, b, own: 2 * a * b, {"n0", "n1"}),
    ],
    ids=["one-sided", "saturating", "periodic", "only with the joint", "two together", "a product of two"],
)
def test_the_form_is_found_and_leaves_the_noise(law: Law, inputs: set[str]) -> None:
    item = rows(law)
    terms = chosen_form([item])
    assert {name for term in terms for name in term.inputs} - {OWN} == inputs
    kept = _left(item, terms, rows(law, seed=99))
    without = _left(item, (), rows(law, seed=99))
    assert kept**2 - NOISE**2 < 0.35 * (without**2 - NOISE**2)


def _left(item: FormRows, terms: tuple[FormTerm, ...], new: FormRows) -> float:
    """RMS on rows that were not fitted."""
    columns, again, sd = item.plain, new.plain, item.plain_sd
    if terms:
        form = LearnedForm.over(terms, [item.inputs])
        columns = np.column_stack([columns, form.columns(item.inputs)[:, 0]])
        again = np.column_stack([again, form.columns(new.inputs)[:, 0]])
        sd = np.concatenate([sd, np.ones(form.count)])
    weights = weight_posterior([Rows(item.free, item.target)], [columns], sd).mean
    base = np.linalg.lstsq(item.free, item.target - columns @ weights, rcond=None)[0]
    inside = np.abs(new.inputs[OWN][:, 0]) < 2
    return float(np.std((new.target - again @ weights - new.free @ base)[inside]))


def test_the_posterior_covers_the_weights() -> None:
    random = np.random.default_rng(3)
    true, scores = np.array([1.0, -2.0, 0.3]), []
    for _ in range(100):
        base = np.column_stack([np.ones(3000), random.standard_normal(3000)])
        columns = random.standard_normal((3000, 3))
        target = base @ [1.0, 2.0] + columns @ true + random.standard_normal(3000)
        found = weight_posterior([Rows(base, target)], [columns], np.full(3, 3.0))
        scores.append((found.mean - true) / np.sqrt(np.diagonal(found.covariance)))
    assert 0.6 < float(np.mean(np.abs(scores) < 1)) < 0.85
