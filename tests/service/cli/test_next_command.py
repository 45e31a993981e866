"""The one command after a diagnosis: activating comes last, and not where nothing could be judged."""

from dataclasses import replace
from typing import Any

import pytest

from glovecal_models.diagnosis.answer import MissingEffects, NamedEffect, TakeSetAside
from glovecal_models.diagnosis.next_take import asked_take
from glovecal_models.diagnosis.residual_answer import Remedy, Unexplained
from glovecal_models.presentation.document import TakeNamed

MODEL = "0123456789abcdef"
NAMED = NamedEffect("nonlinearity", ("I_MCP",), "correction", ("nonlinearity",), {})


def next_command(named: NamedEffect | None = None, left: Unexplained | None = None, **found: Any) -> str:
    following = found.pop("next_take", None)
    about = {"model": MODEL, "subject": "pia", **found}
    return MissingEffects({}, named, (), (), left, following, (), **about).next_command


def test_where_nothing_could_be_judged_a_movement_is_recorded():
    residual = Unexplained(False, "", "the frames are single poses")
    assert next_command(left=residual) == "glovecal record GLOVE free-motion --seconds 60"


def test_where_nothing_is_unexplained_the_model_is_used():
    assert next_command(left=Unexplained(False, "")) == "glovecal model activate 0123456789ab"


def test_what_a_straight_line_cannot_learn_is_trained_otherwise_for_its_subject():
    command = next_command(replace(NAMED, method="lmc_gpr"))
    assert command == "glovecal train --subject pia --method lmc_gpr"
    assert next_command(NAMED) == "glovecal add-effect 0123456789ab nonlinearity --rotation I_MCP"


def test_what_only_the_glove_can_be_mended_for_is_recorded_again():
    named = replace(NAMED, effect="sensor_fault", kind="finding")
    assert next_command(named) == "glovecal record GLOVE after-mending --seconds 60"
    repaired = replace(named, kind="repair")
    assert next_command(repaired) == "glovecal add-effect 0123456789ab sensor_fault"


def test_an_association_has_its_command():
    action = Remedy(
        "I_MCP", "sensor M_MCP", "sensor M_MCP", "column:M_MCP", False, None, 2.0, 1.0, 2.0, True, False
    )
    residual, idle = Unexplained(True, ""), replace(action, saves=False)
    expected = "glovecal add-effect 0123456789ab column:M_MCP --rotation I_MCP"
    assert next_command(left=residual, actions=[action]) == expected
    otherwise = [idle, replace(idle, effect=None, method="lmc_gpr")]
    command = next_command(left=residual, actions=otherwise)
    assert command == "glovecal train --subject pia --method lmc_gpr"
    assert next_command(left=residual, actions=[idle]) == (
        "glovecal where 0123456789ab --report where-0123456789ab.html"
    )


@pytest.mark.parametrize(
    ("motion", "command"),
    [
        ("ramps", "glovecal record GLOVE ramps --seconds 40"),
        ("palm", "glovecal record GLOVE palm --seconds 40"),
        ("one_finger", "glovecal record GLOVE one-finger --seconds 40"),
        ("more_wearings", "glovecal record GLOVE free-motion --seconds 40"),
        ("taps", "glovecal take latency GLOVE"),
    ],
)
def test_what_decides_is_recorded_under_the_name_of_its_motion(motion, command):
    following = asked_take(motion, "Move.", 40, ("creep", "hysteresis"))
    assert next_command(next_take=following) == command


def test_a_reference_that_is_wrong_is_looked_at_first() -> None:
    """By the id of the take that is spoken of: names need not be unique."""
    takes = [TakeNamed("aaaaaaaaaaaa", "t1"), TakeNamed("bbbbbbbbbbbb", "t2")]
    problems = ["take t2: I_PIP steps by a full turn"]
    command = next_command(NAMED, takes=takes, reference_problems=problems)
    assert command == "glovecal take check bbbbbbbbbbbb"


def test_a_training_that_is_advised_is_of_the_models_hand() -> None:
    """Takes of both hands are refused."""
    odd = TakeSetAside("t1", "It does not fit.", "nothing", 9.0, 1.0, 9.0, "0123456789ab")
    assert next_command(odd_takes=[odd], method="linear", hand="left") == (
        "glovecal train --subject pia --hand left --method linear --leave-out 0123456789ab"
    )
