"""What happens to most sensors at one moment is no sensor's own fault."""

from __future__ import annotations

from glovecal_models.effects.base.findings import Finding, Stretch
from glovecal_models.effects.sensor_fault.common_faults import without_common_faults


def jump(sensor: str, at_s: float, take: str = "t1", kind: str = "jump") -> Finding:
    return Finding("sensor_fault", (sensor,), "", kind=kind, stretches=(Stretch(take, at_s, 40.0),))


def test_jumps_of_most_sensors_together_are_left_out():
    together = [jump("a", 8.8), jump("b", 8.9), jump("c", 8.8)]
    stuck = jump("d", 8.8, kind="stuck")
    assert without_common_faults([*together, stuck], 5) == [stuck]


def test_jumps_of_few_sensors_or_at_other_moments_stay():
    two = [jump("a", 8.8), jump("b", 8.8)]
    assert without_common_faults(two, 3) == two
    apart = [jump("a", 8.8), jump("b", 20.0), jump("c", 8.8, take="t2")]
    assert without_common_faults(apart, 3) == apart
    three_of_many = [jump("a", 8.8), jump("b", 8.8), jump("c", 8.8)]
    assert without_common_faults(three_of_many, 22) == three_of_many


def test_frames_in_a_wrong_order_are_no_dropouts_of_sensors():
    moments = [Stretch("t1", at, at + 0.1) for at in (3.0, 9.0, 17.0, 30.0)]
    own = Stretch("t1", 25.0, 25.1)
    together = [
        Finding("sensor_fault", (name,), "", kind="dropouts", stretches=(*moments, own)[: 4 + (name == "a")])
        for name in "abc"
    ]
    elsewhere = (Stretch("t1", 21.0, 21.1), Stretch("t2", 3.0, 3.1), moments[0])
    alone = Finding("sensor_fault", ("d",), "", kind="dropouts", stretches=elsewhere)
    assert without_common_faults([*together, alone], 4) == [alone]
