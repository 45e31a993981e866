"""The independence examination against gloves whose pulls are known, and against what people do wrong."""

from __future__ import annotations

import dataclasses
import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from glovecal_models.errors import BadInput
from glovecal_models.independence.answer import Independence
from glovecal_models.independence.independence import examine_independence, proposed_layout
from glovecal_models.independence.smooth_readings import moved_in_name, rotation_in_name
from glovecal_models.layout import Layout
from glovecal_models.takes.take import Take

SENSORS = ("A", "B", "C", "D")
LAYOUT = Layout.from_document(
    {"name": "four", "sensors": list(SENSORS), "rotations": {name: [name] for name in SENSORS}}
)
RATE_HZ, SECONDS = 40.0, 24.0
TIME = np.arange(round(RATE_HZ * SECONDS)) / RATE_HZ
SWEEP = np.linspace(0, 1, 401)


def sweep(speed_hz: float) -> np.ndarray:
    """From 0 to 1 and back at constant speed, after half a second of rest."""
    return 1 - np.abs(1 - 2 * (speed_hz * np.maximum(TIME - 0.5, 0) % 1.0))


def recorded(
    name: str, joints: dict[str, np.ndarray], *, measured: bool = False, seed: int = 0, **pulls
) -> Take:
    """Joints in shares of 0..1; a sensor reads 100 counts a range, and what ``pulls`` adds, in shares."""
    random = np.random.default_rng(seed)
    angles = np.column_stack([joints.get(sensor, np.zeros(len(TIME))) for sensor in SENSORS])
    strain = angles + np.column_stack([pulls.get(sensor, np.zeros(len(TIME))) for sensor in SENSORS])
    readings = 50 + 100 * strain + 0.5 * random.standard_normal(strain.shape)
    take = Take(name, "w", SENSORS, TIME, readings)
    if not measured:
        return take
    noisy = 60 * angles + 0.3 * random.standard_normal(angles.shape)
    return Take(name, "w", SENSORS, TIME, readings, SENSORS, TIME, noisy)


RANGES = [recorded(f"range-{sensor}", {sensor: sweep(0.25)}, seed=7) for sensor in SENSORS]


def coupled(b: np.ndarray, c: np.ndarray) -> np.ndarray:
    """What B and C do to A: a line, a curve, and less than both when both are bent."""
    return 0.3 * b + 0.4 * c**2 - 0.2 * b * c


def both_ways(b: np.ndarray, c: np.ndarray, **options) -> Independence:
    takes = [
        recorded("still-A", {"B": b, "C": c}, A=coupled(b, c), **options),
        recorded("still-B", {"A": sweep(0.3), "C": sweep(0.43)}, **options),
    ]
    return examine_independence(LAYOUT, takes, RANGES)


def test_shares_of_movements_that_overlap_are_those_of_the_pulls():
    b, free = sweep(0.31), sweep(0.47)
    for c in (free, 0.4 * b + 0.6 * free):  # the second moves in part as the first does
        found = both_ways(b, c).of("A")
        assert found is not None
        assert found.is_coupled
        shares = {share.sensor: share for share in found.affecting}
        assert set(shares) == {"B", "C"}
        for name, curve in {"B": 0.3 * SWEEP, "C": 0.4 * (c.min() + np.ptp(c) * SWEEP) ** 2}.items():
            share = shares[name]
            std, largest = 100 * curve.std(), 100 * np.abs(curve - curve.mean()).max()
            assert share.std_pct == pytest.approx(std, abs=1.2)
            assert share.max_pct == pytest.approx(largest, abs=3.0)
            assert share.std_low < share.std_pct < share.std_high
            assert share.affects == "yes"
        assert found.products
        target = 100 * coupled(b, c)
        assert found.std_pct == pytest.approx(target.std(), abs=0.7)
        assert found.max_pct == pytest.approx(np.abs(target - target.mean()).max(), abs=2.0)


def test_where_joints_hardly_move_apart_the_interval_is_wide_and_nothing_is_decided():
    b, free = sweep(0.31), sweep(0.47)
    found = both_ways(b, 0.85 * b + 0.15 * free).of("A")
    assert found is not None
    for share in found.affecting:
        assert share.affects == "undecided"
        assert share.std_high > 2 * share.std_low
    true = 100 * (0.3 * SWEEP).std()
    (of_b,) = (share for share in found.affecting if share.sensor == "B")
    assert of_b.std_low < true < of_b.std_high


def test_a_coupling_is_one_way_and_becomes_a_proposal():
    found = both_ways(sweep(0.31), sweep(0.47))
    back = found.of("B")
    assert back is not None
    assert not back.is_coupled
    assert back.affecting == ()
    assert back.not_moved == ("D",)
    offered = {item.rotation: item for item in found.proposals}
    assert (offered["A"].kind, set(offered["A"].sensors)) == ("MS1R", {"A", "B", "C"})
    assert offered["A"].is_sure
    assert (offered["B"].kind, offered["B"].is_change) == ("1S1R", False)
    assert offered["C"].is_sure is None
    layout = proposed_layout(LAYOUT, tuple(offered.values()), "mine")
    assert layout.name == "mine"
    assert set(layout.correspondence("A").sensors) == {"A", "B", "C"}
    assert layout.correspondence("B").sensors == ("B",)
    unchanged = proposed_layout(LAYOUT, tuple(offered.values()), "mine", only=["B"])
    assert unchanged.correspondence("A").sensors == ("A",)
    with pytest.raises(BadInput, match="no proposal for 'C'"):
        proposed_layout(LAYOUT, tuple(offered.values()), "mine", only=["C"])


def test_a_sensor_pulled_along_is_no_cause():
    """B pulls on A and on D: D moves with B, and would fit A as well."""
    b = sweep(0.31)
    takes = [
        recorded("still-A", {"B": b}, A=0.3 * b, D=0.5 * b),
        recorded("still-D", {"B": b}, A=0.3 * b, D=0.5 * b, seed=1),
    ]
    found = examine_independence(LAYOUT, takes, RANGES)
    for rotation in ("A", "D"):
        item = found.of(rotation)
        assert item is not None
        assert [(share.sensor, share.affects) for share in item.affecting] == [("B", "yes")]


def test_joints_that_always_move_together_are_told_as_rivals():
    b = sweep(0.31)
    found = examine_independence(LAYOUT, [recorded("still-A", {"B": b, "C": b}, A=0.3 * b)], RANGES)
    item = found.of("A")
    assert item is not None
    (share,) = item.affecting
    assert share.affects == "undecided"
    assert {share.sensor, *share.rivals} == {"B", "C"}
    assert any("is not identifiable" in doubt for doubt in item.doubts)
    assert not found.proposals[0].is_sure
    apart = [recorded(f"still-A-move-{n}", {n: b}, A=0.3 * b if n == "B" else 0 * b) for n in ("B", "C")]
    told = examine_independence(LAYOUT, apart, RANGES).of("A")
    assert told is not None
    assert [share.sensor for share in told.affecting] == ["B"]


def test_a_joint_that_was_not_still_is_seen():
    b, own = sweep(0.31), 0.4 * sweep(0.11)
    measured = examine_independence(
        LAYOUT, [recorded("still-A", {"A": own, "B": b}, A=0.2 * b, measured=True)], RANGES
    ).of("A")
    assert measured is not None
    assert measured.still is not None
    assert not measured.still.is_still
    assert "was not still" in measured.doubts[0]
    (share,) = measured.affecting
    assert share.std_pct == pytest.approx(20 * SWEEP.std(), abs=0.7)
    assert measured.std_pct == pytest.approx(20 * b.std(), abs=0.7)
    unseen = examine_independence(LAYOUT, [recorded("still-A", {"A": own, "B": b}, A=0.2 * b)], RANGES).of(
        "A"
    )
    assert unseen is not None
    assert "really kept still" in unseen.doubts[0]


def test_dead_sensors_and_ranges_that_were_not_seen():
    b = sweep(0.31)
    still = recorded("still-A", {"B": b}, A=0.2 * b)
    silent = still.readings.copy()
    silent[:, 0] = 50.0
    dead = Take("still-A", "w", SENSORS, TIME, silent)
    assert "A" in examine_independence(LAYOUT, [dead], RANGES[1:]).dead_sensors
    nothing = examine_independence(LAYOUT, [still])
    assert not nothing.rotations
    assert "record a take called range-A" in " ".join(nothing.sentences)
    with_counts = Layout.from_document(LAYOUT.to_document() | {"counts": [0, 255]})
    item = examine_independence(with_counts, [still]).of("A")
    assert item is not None
    assert item.active_range.source == "what the glove can send"
    assert any("too small" in doubt for doubt in item.doubts)


def test_which_rotation_was_still_comes_from_names_angles_or_the_user():
    b = sweep(0.31)
    take = recorded("walk", {"B": b, "C": b, "D": b}, A=0.2 * b, measured=True)
    assert examine_independence(LAYOUT, [take], RANGES).still == {"walk": ("A",)}
    bare = recorded("walk", {"B": b})
    with pytest.raises(BadInput, match="call it like still-A"):
        examine_independence(LAYOUT, [bare], RANGES)
    assert examine_independence(LAYOUT, [bare], RANGES, {"walk": "D"}).still == {"walk": ("D",)}
    rotations = ("I_MCP", "IM_ABD", "MCP")
    assert rotation_in_name("Still im-abd 2", rotations) == "IM_ABD"
    assert rotation_in_name("still-IM_ABD-move-I_MCP", rotations) == "IM_ABD"
    assert moved_in_name("still-IM_ABD-move-I_MCP", rotations) == ("I_MCP",)
    assert rotation_in_name("stillness", rotations) is None
    assert moved_in_name("still-IM_ABD", rotations) == ()


def test_a_rotation_that_sensors_share_has_none_of_its_own():
    sleeve = Layout.from_columns("sleeve", SENSORS, ["FLEXION", "INVERSION"])
    with pytest.raises(BadInput, match="no rotation of layout 'sleeve' has a sensor of its own"):
        examine_independence(sleeve, [recorded("walk", {"B": sweep(0.31)})])
    with pytest.raises(BadInput, match="FLEXION has no sensor of its own"):
        examine_independence(sleeve, [recorded("still-FLEXION", {"B": sweep(0.31)})])
    renamed = Layout.from_document(LAYOUT.to_document() | {"rotations": {"KNEE": ["A"]}, "order": ["KNEE"]})
    takes = [recorded("still-knee", {"B": sweep(0.31)}, A=0.3 * sweep(0.31))]
    (item,) = examine_independence(renamed, takes, RANGES).rotations
    assert (item.rotation, item.sensor) == ("KNEE", "A")


@settings(max_examples=8)
@given(
    gain=st.lists(st.floats(0.2, 50).flatmap(lambda g: st.sampled_from([g, -g])), min_size=4, max_size=4),
    zero=st.lists(st.floats(-1000, 1000), min_size=4, max_size=4),
)
def test_per_cents_do_not_depend_on_a_sensors_units(gain: list[float], zero: list[float]):
    """Counts or volts, rising or falling: the same glove."""
    b, c = sweep(0.31), sweep(0.47)
    takes = [recorded("still-A", {"B": b, "C": c}, A=coupled(b, c)), *RANGES]
    other = [Take(t.name, "w", SENSORS, TIME, np.array(zero) + np.array(gain) * t.readings) for t in takes]
    one = examine_independence(LAYOUT, takes[:1], takes[1:]).of("A")
    two = examine_independence(LAYOUT, other[:1], other[1:]).of("A")
    assert one is not None
    assert two is not None
    assert two.std_pct == pytest.approx(one.std_pct, rel=1e-6)
    assert [share.sensor for share in two.affecting] == ["C", "B"]
    for first, second in zip(one.affecting, two.affecting, strict=True):
        assert second.std_pct == pytest.approx(first.std_pct, rel=1e-3)


@settings(max_examples=40)
@given(
    frames=st.integers(1, 60),
    values=st.sampled_from(["still", "steps", "noise", "huge"]),
    measured=st.sampled_from(["none", "all", "gaps"]),
    pre_roll=st.booleans(),
    seed=st.integers(0, 99),
)
def test_any_take_is_examined_or_refused_in_a_sentence(
    frames: int, values: str, measured: str, pre_roll: bool, seed: int
):
    """Single frames, dead sensors, wild readings, angles with gaps: figures are finite or there are none."""
    random = np.random.default_rng(seed)
    time = np.arange(frames) * random.uniform(0.005, 2.0)
    made = {
        "still": np.full((frames, 4), 7.0),
        "steps": np.repeat(random.integers(0, 256, (frames, 1)), 4, axis=1).astype(float),
        "noise": random.standard_normal((frames, 4)),
        "huge": 1e12 * random.standard_normal((frames, 4)),
    }[values]
    take = Take("still-A", "w", SENSORS, time, made, begins_s=float(time[-1]) + 1 if pre_roll else None)
    if measured != "none":
        angles = random.uniform(-90, 90, (frames, 4))
        angles[:: 2 if measured == "gaps" else frames + 1] = np.nan
        take = dataclasses.replace(take, rotations=SENSORS, reference_time_s=time, reference=angles)
    for ranges in (RANGES, [take]):
        found = examine_independence(LAYOUT, [take], ranges)
        assert len(found.rotations) == 1 or found.sentences
        figures = [(item.std_pct, item.max_pct, item.unexplained_pct) for item in found.rotations]
        shares = [dataclasses.asdict(one) for item in found.rotations for one in item.affecting]
        json.dumps([figures, shares], allow_nan=False)
        assert all([*found.sentences, *(item.sentence for item in found.proposals)])
