"""The one command after a diagnosis: activating comes last, and not where nothing could be judged."""

from glovecal_service.next_command import next_command

MODEL = "0123456789abcdef"


def test_where_nothing_could_be_judged_a_movement_is_recorded():
    left = {"is_left": False, "not_judgeable": "the frames are single poses"}
    said = next_command(MODEL, {"named": None, "next_take": None, "something_left": left})
    assert said == "glovecal record GLOVE free-motion --seconds 60"


def test_where_nothing_is_left_the_model_is_used():
    left = {"is_left": False, "not_judgeable": None}
    found = {"named": None, "next_take": None, "something_left": left}
    assert next_command(MODEL, found) == "glovecal model activate 0123456789ab"
