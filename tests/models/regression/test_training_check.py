"""What cannot carry a model is refused with a sentence that names it."""

import numpy as np
import pytest

from glovecal_models.errors import NotTrainable
from glovecal_models.regression.training_samples import check_samples, standardise


def samples(count: int = 20) -> tuple[np.ndarray, np.ndarray]:
    generator = np.random.default_rng(0)
    return generator.integers(0, 256, size=(count, 2)).astype(float), generator.normal(size=count)


def test_good_samples_pass_as_float64() -> None:
    inputs, target = samples()
    checked_inputs, checked_target = check_samples(inputs.astype(int), target.astype(np.float32))
    assert checked_inputs.dtype == checked_target.dtype == np.float64
    assert np.array_equal(checked_inputs, inputs)


@pytest.mark.parametrize(("value", "text"), [(np.nan, "nan"), (np.inf, "inf")])
def test_reading_that_is_not_finite_is_named(value: float, text: str) -> None:
    inputs, target = samples()
    inputs[4, 1] = value
    with pytest.raises(NotTrainable, match=f"sensor I_PIP reads {text} in sample 5"):
        check_samples(inputs, target, ["I_MCP", "I_PIP"])


def test_unmeasured_reference_is_refused() -> None:
    inputs, target = samples()
    target[[2, 3]] = np.nan
    with pytest.raises(NotTrainable, match="sample 3; leave out the 2 samples"):
        check_samples(inputs, target)


def test_too_few_samples_are_refused_with_the_number_needed() -> None:
    with pytest.raises(NotTrainable, match="9 samples are too few for 2 sensors; at least 10"):
        check_samples(*samples(9))
    check_samples(*samples(4), least=4)


def test_constant_sensor_and_constant_target_are_refused_by_name() -> None:
    inputs, target = samples()
    still = inputs.copy()
    still[:, 0] = 17.0
    with pytest.raises(NotTrainable, match="sensor I_MCP reads 17 in all 20 samples"):
        check_samples(still, target, ["I_MCP", "I_PIP"])
    with pytest.raises(NotTrainable, match=r"sensor out; name the others \(I_PIP\) in a layout file"):
        check_samples(still, target, ["I_MCP", "I_PIP"])
    still[:, 1] = -0.0
    with pytest.raises(NotTrainable, match="sensor I_MCP reads 17, sensor I_PIP reads 0 in all 20 samples"):
        check_samples(still, target, ["I_MCP", "I_PIP"])
    with pytest.raises(NotTrainable, match="reference angle is 0 degrees in all 20"):
        check_samples(inputs, np.zeros(20))


@pytest.mark.parametrize(
    ("inputs", "target"),
    [
        (np.zeros(3), np.zeros(3)),
        (np.zeros((3, 0)), np.zeros(3)),
        (np.zeros((3, 1)), np.zeros((3, 1))),
        (np.array([["a"]]), np.zeros(1)),
    ],
)
def test_wrong_shapes_and_text_are_refused(inputs: np.ndarray, target: np.ndarray) -> None:
    with pytest.raises(NotTrainable):
        check_samples(inputs, target)


def test_standardised_samples_have_mean_zero_and_unit_deviation_and_go_back() -> None:
    inputs, target = samples()
    working = standardise(inputs, target)
    assert working.x.mean(axis=0) == pytest.approx([0, 0], abs=1e-14)
    assert working.x.std(axis=0) == pytest.approx([1, 1])
    assert working.input_shift + working.input_scale * working.x == pytest.approx(inputs)
    assert working.target_shift + working.target_scale * working.y == pytest.approx(target)
