"""The minimiser: the lower of two valleys, bounds, unreachable places, cancel."""

import numpy as np
import pytest
from scipy.optimize import rosen, rosen_der

from glovecal_models.errors import Cancelled
from glovecal_models.regression.optimise import counted_progress, minimise


def two_valleys(p: np.ndarray) -> tuple[float, np.ndarray]:
    """Minima near -1 and (lower) near 1."""
    x = p[0]
    return (x * x - 1) ** 2 - 0.3 * x, np.array([4 * x * (x * x - 1) - 0.3])


def test_several_starts_find_the_lower_valley_and_one_may_not() -> None:
    bounds = [(-3.0, 3.0)]
    stuck = minimise(two_valleys, [np.array([-0.9])], bounds)
    found = minimise(two_valleys, [np.array([-0.9]), np.array([1.2])], bounds)
    assert stuck.parameters[0] == pytest.approx(-0.96, abs=0.01)
    assert found.parameters[0] == pytest.approx(1.035, abs=0.01)
    assert found.value == min(found.start_values)
    assert len(found.start_values) == 2
    assert found.evaluations > stuck.evaluations


def test_starts_outside_are_moved_in_and_bounds_hold() -> None:
    optimum = minimise(two_valleys, [np.array([9.0])], [(1.5, 3.0)])
    assert optimum.parameters[0] == pytest.approx(1.5)


def test_rosenbrock_to_six_digits_and_early_end_when_gains_are_small() -> None:
    def objective(p: np.ndarray) -> tuple[float, np.ndarray]:
        return float(rosen(p)), rosen_der(p)

    free = [(-np.inf, np.inf)] * 4
    optimum = minimise(objective, [np.zeros(4)], free, least_gain=1e-12)
    assert optimum.parameters == pytest.approx(np.ones(4), abs=1e-5)
    rough = minimise(objective, [np.zeros(4)], free, least_gain=0.05)
    assert rough.evaluations < optimum.evaluations
    assert minimise(objective, [np.zeros(4)], free, iterations=3).evaluations < 10


def test_places_that_cannot_be_evaluated_are_avoided() -> None:
    def objective(p: np.ndarray) -> tuple[float, np.ndarray]:
        if p[0] < 0:
            raise np.linalg.LinAlgError("not positive definite")
        return two_valleys(p)

    assert minimise(objective, [np.array([0.1])], [(-3.0, 3.0)]).parameters[0] == pytest.approx(
        1.035, abs=0.01
    )
    with pytest.raises(np.linalg.LinAlgError, match="any start"):
        minimise(objective, [np.array([-1.0])], [(-3.0, 3.0)])


def test_cancel_and_progress() -> None:
    with pytest.raises(Cancelled):
        minimise(two_valleys, [np.array([0.0])], [(-3.0, 3.0)], cancelled=lambda: True)
    heard: list[tuple[str, float]] = []
    minimise(
        two_valleys,
        [np.array([0.5])],
        [(-3.0, 3.0)],
        on_evaluation=counted_progress(lambda *a: heard.append(a), "searching", 0.2, 0.8),
    )
    assert heard[0][0] == "searching, evaluation 1"
    assert all(0.2 < fraction < 0.8 for _, fraction in heard)
    assert counted_progress(None, "searching", 0, 1) is None
