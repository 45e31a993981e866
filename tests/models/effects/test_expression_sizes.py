"""A user's columns of any size: fitted alike, or refused with the expression and what is wrong with it."""

from __future__ import annotations

import numpy as np
import pytest

from glovecal_models.calibration.training import train
from glovecal_models.calibration.training_settings import TrainingSettings
from glovecal_models.effects.catalogue import declared_effect
from glovecal_models.effects.declared.expression_effect import ExpressionEffect
from glovecal_models.errors import BadInput
from glovecal_models.improvement.add_effect import add_effect
from glovecal_models.improvement.addition import Addition
from glovecal_models.layout import Layout
from glovecal_models.takes.take import Take

LAYOUT = Layout.from_columns("one", ["A"], ["A"])
SETTINGS = TrainingSettings(method="linear", folds=2)


def strapped(seed: int) -> Take:
    """One sensor that reads 4 counts more for each newton of a strap."""
    random = np.random.default_rng(seed)
    time = np.arange(900) / 30.0
    angle = 40 + 30 * np.sin(time * random.uniform(0.8, 1.2))
    strap = 5 + 3 * np.sin(0.7 * time + seed)
    readings = 100 + 2 * angle + 4 * strap + random.normal(size=900)
    return Take(
        f"t{seed}", f"w{seed}", ("A",), time, readings[:, None], ("A",), time, angle[:, None],
        context={"strap_n": strap, "still_n": np.where(np.arange(900) < 450, 1.0, 2.0)},
    )  # fmt: skip


TAKES = [strapped(seed) for seed in range(4)]
MODEL = train(TAKES, LAYOUT, "anna", SETTINGS)


def added(columns: str) -> Addition:
    effect = ExpressionEffect.parse(f"name = strap; columns = {columns}")
    return add_effect(MODEL, TAKES, effect, settings=SETTINGS)


@pytest.mark.parametrize("factor", ["1e-6", "1e6", "1e8"])
def test_the_unit_of_a_column_does_not_matter(factor):
    plain, scaled = added("c.strap_n"), added(f"c.strap_n * {factor}")
    assert plain.added
    assert scaled.added
    assert scaled.after.rmse_deg("A") == pytest.approx(plain.after.rmse_deg("A"), rel=1e-6)
    (weight,), (other,) = (list(item.parameters["A"].values()) for item in (plain, scaled))
    assert other * float(factor) == pytest.approx(weight, rel=1e-4)


@pytest.mark.parametrize(
    ("columns", "said"),
    [
        (
            "own * 1e300",
            r"'own \* 1e300' reaches .*e\+300 at frame .* of take t0 .*at most 1e\+09 can be fitted",
        ),
        ("exp(c.strap_n * 10)", r"'exp\(c.strap_n \* 10\)' reaches .* write it without one"),
        ("c.strap_n * 0", r"column 'c.strap_n \* 0' is always 0; write one that changes with the hand"),
        ("400 + 0 * own", r"column '400 \+ 0 \* own' is always 400"),
        ("1 / (c.still_n - 1)", "division by zero in .* guard it"),
        ("exp(exp(own + 10))", "too large in 'exp"),
    ],
)
def test_what_cannot_be_fitted_is_refused_by_its_own_name(columns, said):
    with pytest.raises(BadInput, match=said):
        added(columns)


@pytest.mark.parametrize(
    ("columns", "said"),
    [
        ("own * 1e300", r"1e300 in 'own \* 1e300': at most 1e\+09"),
        ("own / 1e999", "1e999 is too large a number"),
        ("own, 5 + 1", r"'5 \+ 1' is the same in every frame"),
    ],
)
def test_what_shows_before_any_take_is_refused_when_it_is_declared(columns, said):
    with pytest.raises(BadInput, match=said):
        declared_effect(f"name = strap; columns = {columns}")
    declared_effect("name = strap; columns = own * 1e6")
