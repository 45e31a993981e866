"""The learned form of an effect: a Gaussian process in a fixed number of columns."""

from __future__ import annotations

import json

import numpy as np
import pytest

from glovecal_models.effects.base.learned_form import OWN, REACH, FormTerm, LearnedForm
from glovecal_models.errors import BadInput


@pytest.mark.parametrize("lengthscale", [0.25, 0.7])
def test_columns_are_a_gaussian_process(lengthscale: float) -> None:
    """Their covariance for weights of size one is the squared-exponential kernel."""
    x = np.linspace(-1, 1, 41)
    term = FormTerm(("bend",), lengthscale, 3.0)
    columns = term.columns([x[:, None]])[:, 0]
    expected = 9.0 * np.exp(-0.5 * ((x[:, None] - x[None, :]) / lengthscale) ** 2)
    inside = np.abs(x) <= 0.5  # the walls of the box are felt within a lengthscale of them
    got = columns @ columns.T
    assert np.abs(got - expected)[np.ix_(inside, inside)].max() < 0.12 * 9.0
    if lengthscale <= 0.25:
        assert np.abs(got - expected).max() < 0.02 * 9.0


def test_two_inputs_are_a_product_kernel() -> None:
    random = np.random.default_rng(0)
    places = random.uniform(-0.5, 0.5, (2, 60, 1))
    columns = FormTerm(("bend", OWN), 0.6, 2.0).columns(list(places))[:, 0]
    distance = sum((place - place.T) ** 2 for place in places)
    expected = 4.0 * np.exp(-0.5 * distance / 0.6**2)
    assert np.abs(columns @ columns.T - expected).max() < 0.15 * 4.0


def _form() -> tuple[LearnedForm, dict[str, np.ndarray]]:
    random = np.random.default_rng(1)
    inputs = {"bend": random.uniform(-3, 7, (200, 2)), OWN: random.uniform(0, 90, (200, 2))}
    terms = (FormTerm(("bend",), 0.25, 2.0), FormTerm(("bend", OWN), 0.6, 6.0))
    return LearnedForm.over(terms, [inputs]), inputs


def test_its_document_is_plain_and_gives_it_back() -> None:
    form, inputs = _form()
    again = LearnedForm.from_document(json.loads(json.dumps(form.to_document())))
    assert again == form
    np.testing.assert_array_equal(again.columns(inputs), form.columns(inputs))
    assert form.columns(inputs).shape == (200, 2, form.count)


def test_a_frame_is_what_it_is_in_a_take() -> None:
    form, inputs = _form()
    whole = form.columns(inputs)
    for row in (0, 17, 199):
        alone = form.columns({name: values[[row]] for name, values in inputs.items()})
        np.testing.assert_allclose(alone[0], whole[row], rtol=0, atol=1e-12)


def test_far_outside_the_last_value_is_held() -> None:
    form, inputs = _form()
    far = {name: values + 1000 for name, values in inputs.items()}
    farther = {name: values + 5000 for name, values in inputs.items()}
    np.testing.assert_array_equal(form.columns(far), form.columns(farther))
    assert np.isfinite(form.columns(far)).all()
    assert form.place(OWN, far[OWN]).max() == REACH


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"terms": []}, "1 to 16 terms"),
        ({"low": {}}, "has ranges of"),
        ({"terms": [{"inputs": ["a", "b", "c"], "lengthscale": 1, "sd_deg": 1}]}, "1 or 2 inputs"),
        ({"terms": [{"inputs": ["bend"], "lengthscale": 0, "sd_deg": 1}]}, "lengthscale"),
        ({"terms": 3}, "not a learned form"),
    ],
)
def test_a_damaged_document_is_refused(change: dict[str, object], says: str) -> None:
    with pytest.raises(BadInput, match=says):
        LearnedForm.from_document(_form()[0].to_document() | change)
