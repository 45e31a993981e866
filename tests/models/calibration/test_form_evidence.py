"""What one more term of a form gains equals the likelihood of all columns together, worked out directly."""

from __future__ import annotations

import numpy as np

from glovecal_models.calibration.form_choice import EVERY, FormRows
from glovecal_models.calibration.held_out import ALIKE_ROWS
from glovecal_models.effects.base.learned_form import BOX, OWN, FormTerm, LearnedForm, sines

COUNT = 600
TERMS = (
    FormTerm(("a", OWN), 0.8, 2.0),
    FormTerm(("a",), 0.3, 6.0),
    FormTerm(("a",), 0.12, 2.0),
    FormTerm(("a", OWN), 0.35, 6.0),
    FormTerm(("a", "b"), 0.8, 2.0),
)


def rows() -> FormRows:
    random = np.random.default_rng(3)
    own, a, b = random.uniform(-1, 1, (3, COUNT))
    target = 20 * own + 3 * np.maximum(a, 0.0) * own + np.sin(4 * b) + 0.3 * random.standard_normal(COUNT)
    inputs = {"a": a[:, None], "b": b[:, None], OWN: own[:, None]}
    free = np.polynomial.legendre.legvander(own, 7)
    return FormRows(free, np.column_stack([a, b]), np.array([3.0, 1.0]), inputs, target)


def direct(given: FormRows, terms: list[FormTerm], variance: float) -> float:
    """Nats, with ``variance`` as the noise: of N rows with the covariance of all weights."""
    form = LearnedForm.over(list(TERMS), [given.inputs])
    every = [given.plain * given.plain_sd]
    for term in terms:
        place = [form.place(name, given.inputs[name]) for name in term.inputs]
        every.append(term.columns(place)[:, 0])
    orthogonal = np.linalg.qr(given.free)[0]
    columns = np.concatenate(every, axis=1)
    columns = columns - orthogonal @ (orthogonal.T @ columns)
    target = given.target - orthogonal @ (orthogonal.T @ given.target)
    noise = ALIKE_ROWS / EVERY * variance
    covariance = np.eye(COUNT) + columns @ columns.T / noise
    told = target @ target - target @ np.linalg.solve(covariance, target)
    return 0.5 * float(told) / noise - 0.5 * float(np.linalg.slogdet(covariance)[1])


def test_a_gain_is_the_difference_of_two_likelihoods_whatever_was_asked_before() -> None:
    given = rows()
    lane = given.evidence()
    # The noise before anything is chosen: what the base leaves.
    orthogonal = np.linalg.qr(given.free)[0]
    left = given.target - orthogonal @ (orthogonal.T @ given.target)
    variance = float(left @ left) / COUNT
    before = direct(given, [], variance)
    np.testing.assert_allclose(lane.evidence(), before, rtol=1e-9)
    for term in TERMS:  # from coarse to fine and back
        expected = direct(given, [term], variance) - before
        np.testing.assert_allclose(lane.gain(term), expected, rtol=1e-7, atol=1e-9)


def test_a_gain_beside_chosen_terms_has_their_columns_and_their_noise() -> None:
    given = rows()
    for chosen in ([TERMS[0]], [TERMS[1], TERMS[3]]):
        lane = given.evidence()
        lane.settle(chosen)
        now = lane.evidence()
        for term in TERMS:
            together = given.evidence()
            together.settle([*chosen, term])
            together.share_noise(lane)
            np.testing.assert_allclose(lane.gain(term), together.evidence() - now, rtol=1e-6, atol=1e-7)


def test_sines_from_the_two_before_are_those_of_their_own_angle() -> None:
    place = np.linspace(-1.3, 1.3, 201)
    half_waves = np.arange(1, 25)[:, None] * (0.5 * np.pi / BOX) * (place + BOX)
    np.testing.assert_allclose(sines(place, 24), np.sin(half_waves) / np.sqrt(BOX), atol=1e-12)
