"""An effect that a model has: its joints run together give what each gives alone, wherever measured."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

from glovecal_models.diagnosis.known_effect import KnownEffect
from glovecal_models.diagnosis.problem import DiagnosisProblem
from glovecal_models.effects.catalogue import effect
from glovecal_models.layout import Layout
from glovecal_models.simulation.session import record_session
from glovecal_models.simulation.session_plan import SessionPlan

SENSORS = ("I_MCP", "I_PIP", "M_MCP")
LAYOUT = Layout.from_columns("three", SENSORS, SENSORS)
CREEP = effect("creep")
SHAPES = (np.array([0.5, 2.0, 8.0]), np.array([0.75, 3.0, 12.0]))


@pytest.fixture(scope="module")
def problem() -> DiagnosisProblem:
    takes = record_session(SessionPlan(seed=3, sensors=SENSORS, wearings=1, take_s=12.0)).takes
    return DiagnosisProblem.of(takes, LAYOUT, False, ())


def test_joints_together_give_what_each_gives_alone(problem):
    design = problem.design()
    known = KnownEffect(CREEP, ("M_MCP", "I_MCP"), SHAPES)
    together = known.side_by_side(design.signals, design.rotations)
    for name in known.joints:
        lane = design.rotations.index(name)
        alone = known.columns(design.signals, lane, name)
        both = known.columns(design.signals, lane, name, together)
        assert alone is not None
        assert both is not None
        for one, other in zip(alone.parts, both.parts, strict=True):
            assert other == pytest.approx(one, abs=1e-12)


def test_a_joint_that_these_takes_did_not_measure_is_left_out(problem):
    design = problem.design()
    known = KnownEffect(CREEP, ("W_FLEX", "I_MCP"), SHAPES)
    assert set(known.side_by_side(design.signals, design.rotations)) == {"I_MCP"}
    assert problem.beside(known).design().mean_square().keys() == design.mean_square().keys()


def test_workers_are_sent_the_effect_without_what_was_kept(problem):
    design = problem.design()
    known = KnownEffect(CREEP, ("I_MCP",), SHAPES[:1])
    known.side_by_side(design.signals, design.rotations)
    assert known.kept
    sent = pickle.loads(pickle.dumps(known))
    assert not sent.kept
    assert sent.joints == known.joints
