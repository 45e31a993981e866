"""The one command after a diagnosis: activating comes last, and not where nothing could be judged."""

import pytest

from glovecal_models.diagnosis.next_take import NextTake
from glovecal_service.next_command import next_command
from glovecal_service.views.next_take import NextTakeView

MODEL = "0123456789abcdef"


def test_where_nothing_could_be_judged_a_movement_is_recorded():
    residual = {"is_significant": False, "not_identifiable": "the frames are single poses"}
    command = next_command(MODEL, {"named": None, "next_take": None, "unexplained_residual": residual})
    assert command == "glovecal record GLOVE free-motion --seconds 60"


def test_where_nothing_is_unexplained_the_model_is_used():
    residual = {"is_significant": False, "not_identifiable": None}
    found = {"named": None, "next_take": None, "unexplained_residual": residual}
    assert next_command(MODEL, found) == "glovecal model activate 0123456789ab"


def test_what_a_straight_line_cannot_learn_is_trained_otherwise_for_its_subject():
    named = {"effect": "nonlinearity", "kind": "correction", "verdict": "named", "where": ["I_MCP"]}
    found = {"named": {**named, "method": "lmc_gpr"}, "next_take": None}
    assert next_command(MODEL, found, "pia") == "glovecal train --subject pia --method lmc_gpr"
    without = {"named": named, "next_take": None}
    assert next_command(MODEL, without, "pia").startswith("glovecal add-effect 0123456789ab nonlinearity")


def test_what_only_the_glove_can_be_mended_for_is_recorded_again():
    named = {"effect": "sensor_fault", "kind": "finding", "verdict": "named", "where": ["I_MCP"]}
    command = next_command(MODEL, {"named": named, "next_take": None})
    assert command == "glovecal record GLOVE after-mending --seconds 60"
    repaired = {"named": {**named, "kind": "repair"}, "next_take": None}
    assert next_command(MODEL, repaired) == "glovecal add-effect 0123456789ab sensor_fault"


def test_an_association_has_its_command():
    action = {"rotation": "I_MCP", "effect": "column:M_MCP", "method": None, "saves": True}
    residual = {"is_significant": True, "not_identifiable": None}
    found = {"named": None, "next_take": None, "actions": [action], "unexplained_residual": residual}
    expected = "glovecal add-effect 0123456789ab column:M_MCP --rotation I_MCP"
    assert next_command(MODEL, found, "pia") == expected
    found["actions"] = [{**action, "saves": False}, {**action, "effect": None, "method": "lmc_gpr"}]
    assert next_command(MODEL, found, "pia") == "glovecal train --subject pia --method lmc_gpr"
    found["actions"] = [{**action, "saves": False}]
    assert next_command(MODEL, found, "pia") == (
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
    view = NextTakeView.of(NextTake(motion, "Move.", 40, ("creep", "hysteresis")))
    assert view is not None
    assert next_command(MODEL, {"named": None, "next_take": view.model_dump()}) == command


def test_a_recording_asked_for_by_an_earlier_service_has_its_command():
    following = {"what": "Move.", "seconds": 25, "separates": ["creep", "hysteresis"]}
    found = {"named": None, "next_take": following}
    assert next_command(MODEL, found) == "glovecal record GLOVE deciding --seconds 25"


def test_a_training_that_is_advised_is_of_the_models_hand() -> None:
    """Takes of both hands are refused."""
    found = {"odd_takes": [{"id": "0123456789ab"}], "method": "linear"}
    assert next_command(MODEL, found, "pia", "left") == (
        "glovecal train --subject pia --hand left --method linear --leave-out 0123456789ab"
    )
