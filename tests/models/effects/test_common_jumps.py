"""A jump of most sensors at one moment is no sensor's own fault."""

from __future__ import annotations

from glovecal_models.effects.base.signature_effect import Finding, Stretch
from glovecal_models.effects.sensor_fault.common_jumps import without_common_jumps


def jump(sensor: str, at_s: float, take: str = "t1", kind: str = "jump") -> Finding:
    return Finding("sensor_fault", (sensor,), "", kind=kind, stretches=(Stretch(take, at_s, 40.0),))


def test_jumps_of_most_sensors_together_are_left_out():
    together = [jump("a", 8.8), jump("b", 8.9), jump("c", 8.8)]
    stuck = jump("d", 8.8, kind="stuck")
    assert without_common_jumps([*together, stuck], 5) == [stuck]


def test_jumps_of_few_sensors_or_at_other_moments_stay():
    two = [jump("a", 8.8), jump("b", 8.8)]
    assert without_common_jumps(two, 3) == two
    apart = [jump("a", 8.8), jump("b", 20.0), jump("c", 8.8, take="t2")]
    assert without_common_jumps(apart, 3) == apart
    three_of_many = [jump("a", 8.8), jump("b", 8.8), jump("c", 8.8)]
    assert without_common_jumps(three_of_many, 22) == three_of_many
