"""Sums of squares and products give what fitting each fold by itself gives."""

import numpy as np
import pytest

from glovecal_models.calibration.held_out import (
    ALIKE_ROWS,
    BaseProducts,
    FittedColumns,
    FittedRows,
    Rows,
    held_out,
)


@pytest.fixture
def units() -> list[Rows]:
    random = np.random.default_rng(3)
    found = []
    for _ in range(5):
        base = np.column_stack([np.ones(80), random.normal(size=(80, 2))])
        found.append(Rows(base, base @ [1.0, 2.0, -1.0] + random.normal(size=80)))
    return found


def test_columns_of_zeros_change_nothing(units):
    found = held_out(BaseProducts(units), [np.zeros((80, 2, 1))] * 5, np.ones(1))
    assert found.saved == pytest.approx(0.0, abs=1e-12)
    assert found.added == pytest.approx(found.base)


def test_columns_of_an_effect_in_the_base_may_be_zero(units):
    """As those of a wearing that is in none of the takes that are kept."""
    prior_sd = np.array([np.inf, np.inf, np.inf, 2.0])
    wider = [Rows(np.column_stack([unit.base, np.zeros(80)]), unit.target) for unit in units]
    found = BaseProducts(wider, prior_sd, own=3)
    assert found.whole == pytest.approx([*BaseProducts(units).whole, 0.0])
    assert np.concatenate(found.residual) == pytest.approx(np.concatenate(BaseProducts(units).residual))


def test_every_fold_is_the_ridge_fit_of_the_others(units):
    random = np.random.default_rng(4)
    columns = [random.normal(size=(80, 1, 2)) for _ in units]
    products = BaseProducts(units)
    prior = np.array([1.0, 0.5])
    found = held_out(products, columns, prior)
    variance = products.error.sum() / products.count.sum()
    for left in range(5):
        kept = [i for i in range(5) if i != left]
        x = np.concatenate([np.column_stack([units[i].base, columns[i][:, 0]]) for i in kept])
        y = np.concatenate([units[i].target for i in kept])
        ridge = np.zeros((5, 5))
        ridge[:3, :3] = products.ridge
        ridge[3:, 3:] = np.diag(ALIKE_ROWS * variance / prior**2)
        beta = np.linalg.solve(x.T @ x + ridge, x.T @ y)
        own = np.column_stack([units[left].base, columns[left][:, 0]])
        assert found.residual_added[left] == pytest.approx(units[left].target - own @ beta)


def test_the_shape_is_chosen_by_training_error(units):
    random = np.random.default_rng(5)
    columns, targets = [], []
    for unit in units:
        each = random.normal(size=(80, 3, 1))
        columns.append(each)
        targets.append(Rows(unit.base, unit.target + 4.0 * each[:, 1, 0]))
    found = held_out(BaseProducts(targets), columns, np.ones(1) * 10)
    assert found.shape == 1
    assert found.weights == pytest.approx([4.0], abs=0.3)
    assert found.saved > 0.8


def test_columns_at_fitted_rows_are_those_of_all_rows():
    random = np.random.default_rng(6)
    columns = [random.normal(size=(20, 6, 2)) for _ in range(2)]  # three shapes of two lanes
    units = [
        [(0, np.arange(0, 20, 2)), (1, np.arange(1, 9))],
        [(0, np.arange(4, 20, 2)), (1, np.array([3, 15]))],
    ]
    fitted = FittedRows.of([20, 20], units)
    every = FittedColumns.of(columns, fitted)
    some = [part[at] for part, at in zip(columns, fitted.rows, strict=True)]
    some = FittedColumns.of(some, fitted, are_fitted=True)
    for lane, of_lane in enumerate(units):
        for (take, index), whole, part in zip(of_lane, every.units(lane), some.units(lane), strict=True):
            np.testing.assert_array_equal(whole, columns[take][index][:, lane::2])
            np.testing.assert_array_equal(part, whole)


def test_large_columns_of_an_effect_do_not_loosen_or_tighten_the_base():
    generator = np.random.default_rng(3)
    base = [generator.normal(size=(80, 3)) for _ in range(4)]
    effect = [generator.normal(size=(80, 1)) for _ in range(4)]
    target = [part @ [1.0, -2.0, 0.5] + 0.3 * extra[:, 0] for part, extra in zip(base, effect, strict=True)]

    def coefficients(times):
        units = [
            Rows(np.column_stack([part, times * extra]), angle)
            for part, extra, angle in zip(base, effect, target, strict=True)
        ]
        return BaseProducts(units, own=3).whole * [1.0, 1.0, 1.0, times]

    assert coefficients(1e4) == pytest.approx(coefficients(1.0), rel=1e-9)
    assert coefficients(1e4) == pytest.approx([1.0, -2.0, 0.5, 0.3], rel=1e-5)
