"""Neighbours whose angles tell a joint's own seem to pull at its sensor; only they are no candidates."""

from __future__ import annotations

import numpy as np
import pytest

from glovecal_models.diagnosis.diagnose import diagnose
from glovecal_models.diagnosis.forward_design import tied_angles
from glovecal_models.diagnosis.limits import DIAGNOSIS_LIMITS
from glovecal_models.layout import Layout
from glovecal_models.simulation.causes.form import Cause
from glovecal_models.simulation.session import record_session
from glovecal_models.simulation.session_plan import SessionPlan

SHARE = DIAGNOSIS_LIMITS.same_angle_share
THUMB = ("T_TMC", "TI_ABD", "T_VIR", "T_IP")
LAYOUT = Layout.from_columns("thumb", THUMB, THUMB)


def angles(noise_deg: float) -> np.ndarray:
    """(N, 5) degrees: two that move freely, one that bends with the first, one that follows both, a fifth."""
    random = np.random.default_rng(3)
    free = 20.0 * random.uniform(-1.0, 1.0, (4000, 3))
    first, second, fifth = free.T
    alike = 0.7 * first + 0.004 * first**2
    both = 0.6 * first - 0.5 * second + 0.005 * second**2
    return np.column_stack([first, second, alike, both, fifth]) + random.normal(0, noise_deg, (4000, 5))


def test_angles_that_follow_from_one_or_two_others_are_found():
    tied = tied_angles(angles(0.4)[:, [0, 1, 3, 4]], SHARE)
    assert tied[2] in ({0}, {1})
    assert tied == [{2}, {2}, tied[2], set()]
    with_alike = tied_angles(angles(0.4), SHARE)
    assert 2 in with_alike[0]
    assert with_alike[4] == set()
    assert all(4 not in others for others in with_alike)


@pytest.mark.parametrize("columns", [[0], [0, 1], [0, 1, 4]], ids=len)
def test_angles_that_move_freely_are_not(columns):
    assert tied_angles(angles(0.4)[:, columns], SHARE) == [set() for _ in columns]


@pytest.mark.parametrize("rows", [0, 1, 5, 9, 10, 99, 100])
def test_few_rows_tell_little_and_break_nothing(rows):
    tied = tied_angles(angles(0.4)[:rows], SHARE)
    assert len(tied) == 5
    assert rows >= 10 or not any(tied)


def test_noise_above_the_share_hides_that_an_angle_follows():
    assert tied_angles(angles(4.0)[:, [0, 1, 3, 4]], SHARE) == [set()] * 4


def test_a_joint_that_never_moves_is_tied_to_none():
    still = angles(0.4)[:, [0, 1, 3, 4]]
    still[:, 3] = 12.0
    assert tied_angles(still, SHARE)[3] == set()


@pytest.mark.parametrize("seed", [15, 18, 20])
def test_a_clean_thumb_with_a_virtual_joint_is_left_alone(seed):
    takes = record_session(SessionPlan(seed=seed, sensors=THUMB, takes_per_wearing=3, take_s=20.0)).takes
    assert diagnose(takes, LAYOUT).named is None


def test_a_pull_of_the_thumb_is_found_beside_a_virtual_joint():
    plan = SessionPlan(seed=12, sensors=THUMB, takes_per_wearing=3, take_s=20.0)
    pulled = Cause("cross_coupling", "linear_neighbours", strength_deg=2.5, channels=("T_TMC",))
    named = diagnose(record_session(plan, [pulled]).takes, LAYOUT).named
    assert named is not None
    assert named.effect == "cross_coupling"
    assert "T_TMC" in named.where
