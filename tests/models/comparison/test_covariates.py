"""The columns an error is held against: their names, units and phrases."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from glovecal_models.comparison.dependence import context_unit, covariates
from glovecal_models.comparison.residuals import Residuals, TakeResiduals


def test_every_recorded_column_is_there_once_with_its_unit(
    take_residuals: Callable[..., TakeResiduals], together: Callable[..., Residuals]
) -> None:
    angle, count = np.zeros(60), np.arange(60.0)
    context = {"supply_v": count, "power_on_s": count + 300, "mood": count}
    found = {one.name: one for one in covariates(together(take_residuals(
        angle, angle, angle, context=context)), "A")}  # fmt: skip
    assert list(found) == [
        "angle", "speed", "direction", "time in take", "sensor A", "sensor B",
        "context supply_v", "time since power-on", "context mood",
    ]  # fmt: skip
    on = found["time since power-on"]
    assert (on.unit, on.phrase) == ("s", "how long the glove has been on")
    assert on.values[0][0] == 300
    assert found["context supply_v"].unit == "V"
    assert found["context mood"].unit == ""


@pytest.mark.parametrize(
    ("name", "unit"),
    [("supply_v", "V"), ("skin_temperature_C", "°C"), ("humidity_pct", "%"), ("squeeze_n", "N"), ("v", "")],
)
def test_units_follow_the_end_of_the_name(name: str, unit: str) -> None:
    assert context_unit(name) == unit
