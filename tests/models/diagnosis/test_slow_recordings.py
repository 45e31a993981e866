"""Whether frames go on from one another is told by the recording, not by its rate."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from glovecal_models.diagnosis.diagnose import diagnose
from glovecal_models.diagnosis.next_take import SINGLE_POSES
from glovecal_models.diagnosis.resampled import SHORTEST_BRIDGE_S, bridge_s
from glovecal_models.layout import Layout
from glovecal_models.simulation.causes.form import Cause
from glovecal_models.simulation.session import record_session
from glovecal_models.simulation.session_plan import SessionPlan
from glovecal_models.takes.table import read_takes
from glovecal_models.takes.take import Take

DATA = Path(__file__).parents[4] / "shared" / "data"
SENSORS = ("I_MCP", "I_PIP")
LAYOUT = Layout.from_columns("two", SENSORS, SENSORS)


def at_rate(take: Take, rate_hz: float) -> Take:
    """Every few frames one, the rest left out."""
    step = round(1.0 / (rate_hz * float(np.median(np.diff(take.time_s)))))
    some = slice(None, None, step)
    measured = slice(None, None, 1 if take.has_own_reference_clock else step)
    return replace(
        take,
        time_s=take.time_s[some],
        readings=take.readings[some],
        reference_time_s=take.reference_time_s[measured],
        reference=take.reference[measured],
        context={name: values[some] for name, values in take.context.items()},
        poses=None if take.poses is None else take.poses[some],
    )


def shuffled(take: Take) -> Take:
    """The same pairs of reading and angle, in no order."""
    order = np.random.default_rng(0).permutation(len(take.time_s))
    return replace(take, readings=take.readings[order], reference=take.reference[order], context={})


@pytest.fixture(scope="module")
def sticky() -> Sequence[Take]:
    plan = SessionPlan(seed=5, sensors=SENSORS, wearings=3, takes_per_wearing=3, take_s=30.0)
    return record_session(
        plan, (Cause("hysteresis", "single_play", strength_deg=3.0, channels=("I_PIP",)),)
    ).takes


@pytest.mark.parametrize("rate_hz", [9, 5])
def test_a_slow_recording_is_diagnosed_like_a_fast_one(sticky, rate_hz):
    found = diagnose([at_rate(take, rate_hz) for take in sticky], LAYOUT)
    assert found.naming.confidence_set == ("hysteresis",)
    assert found.residual.obstacle is None
    assert SINGLE_POSES not in [item.why for item in found.not_identifiable]


def test_a_hand_that_holds_still_in_one_take_makes_no_single_poses(sticky):
    slow = [at_rate(take, 9) for take in sticky]
    random = np.random.default_rng(0)
    still = replace(slow[0], readings=100 + random.normal(size=slow[0].readings.shape))
    assert bridge_s([still, *slow[1:]]) > SHORTEST_BRIDGE_S


def test_unordered_poses_are_single_whatever_their_time_stamps_say(sticky):
    poses = [shuffled(at_rate(take, 9)) for take in sticky]
    found = diagnose(poses, LAYOUT)
    assert found.residual.obstacle == "single poses"
    assert "lag" in [item.effect for item in found.not_identifiable if item.why == SINGLE_POSES]


@pytest.mark.needs_shared_data
def test_real_recordings_are_told_from_real_poses():
    thumb = [
        take for path in sorted((DATA / "cyberglove-robot-thumb").glob("*.csv")) for take in read_takes(path)
    ]
    assert bridge_s(thumb) == SHORTEST_BRIDGE_S
    (flex,) = read_takes(DATA / "flex-static" / "one-sensor.csv")
    assert bridge_s([flex]) == SHORTEST_BRIDGE_S, "100 frames a second need no bridge"
    recordings = {"gait": ("P002*", "P003*"), "ankle": tuple(f"P30{number}*.frames" for number in range(5))}
    for folder, people in recordings.items():
        for person in people:
            paths = sorted((DATA / folder).glob(f"{person}.csv"))
            takes = [at_rate(take, 9) for path in paths for take in read_takes(path)]
            assert takes
            assert bridge_s(takes) == pytest.approx(2.5 / 9, rel=0.5), person
