"""The one command after a diagnosis: activating comes last, and not where nothing could be judged."""

from glovecal_service.next_command import next_command

MODEL = "0123456789abcdef"


def test_where_nothing_could_be_judged_a_movement_is_recorded():
    residual = {"is_significant": False, "not_identifiable": "the frames are single poses"}
    command = next_command(MODEL, {"named": None, "next_take": None, "unexplained_residual": residual})
    assert command == "glovecal record GLOVE free-motion --seconds 60"


def test_where_nothing_is_unexplained_the_model_is_used():
    residual = {"is_significant": False, "not_identifiable": None}
    found = {"named": None, "next_take": None, "unexplained_residual": residual}
    assert next_command(MODEL, found) == "glovecal model activate 0123456789ab"
