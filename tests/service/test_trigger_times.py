"""When triggers came by the take's clock, and which of their time codes is the take's."""

from __future__ import annotations

from typing import Any

import pytest

from glovecal_service.recorder.trigger_times import trigger_facts

CLOCK = {"computer": "here", "wall_minus_time_s": 1_000_000.0}


def trigger(**changes: Any) -> dict[str, Any]:
    usual = {
        "protocol": "vicon", "time_code": "", "rate": None, "delay_s": 0.0, "computer": "here",
        "monotonic_s": 500.0, "wall_s": 1_000_500.25,
    }  # fmt: skip
    return usual | changes


def test_a_recording_without_triggers_has_no_such_facts() -> None:
    assert trigger_facts({"sent": 5}, CLOCK) == {}


def test_on_the_capture_computer_its_clock_counts_elsewhere_the_time_of_day() -> None:
    elsewhere = trigger(computer="there", wall_s=1_000_530.0)
    facts = trigger_facts({"trigger": {"start": trigger(delay_s=0.5), "stop": elsewhere}}, CLOCK)
    start, stop = facts["trigger"]["start"], facts["trigger"]["stop"]
    assert (start["time_s"], start["clock"]) == (500.5, "monotonic")
    assert (stop["time_s"], stop["clock"]) == (530.0, "wall")
    assert "time_code" not in facts


CODES = [
    ({"time_code": "01:00:00:00", "rate": "25"}, {}, ("01:00:00:00", "25", False, 500.0)),
    ({"time_code": "01:00:00;00"}, {}, ("01:00:00;00", "29.97", True, 500.0)),
    (
        {},
        {"time_code": "01:00:10:00", "rate": "24", "monotonic_s": 510.0},
        ("01:00:10:00", "24", False, 510.0),
    ),
    ({"time_code": "01:00:00:00"}, {}, None),
    ({"time_code": "99:00:00:00", "rate": "25"}, {}, None),
    ({"time_code": "soon", "rate": "25"}, {}, None),
]


def test_the_code_of_a_line_goes_before_that_of_triggers() -> None:
    running = {"time_code": "10:00:00:05", "rate": "25", "source": "LTC of a line", "computer": "there"}
    running |= {"monotonic_s": 7.0, "wall_s": 1_000_499.5}
    facts = trigger_facts({"time_code": running}, CLOCK)
    assert facts == {
        "time_code": {
            "label": "10:00:00:05", "rate": "25", "drop": False, "time_s": 499.5, "source": "LTC of a line"
        }
    }  # fmt: skip
    start = trigger(time_code="01:00:00:00", rate="25")
    both = trigger_facts({"time_code": {**running, "computer": "here"}, "trigger": {"start": start}}, CLOCK)
    assert (both["time_code"]["label"], both["time_code"]["time_s"]) == ("10:00:00:05", 7.0)
    assert both["trigger"]["start"]["time_code"] == "01:00:00:00"


@pytest.mark.parametrize(("start", "stop", "expected"), CODES)
def test_the_takes_time_code_is_the_first_that_can_be_counted(
    start: dict[str, Any], stop: dict[str, Any], expected: tuple[Any, ...] | None
) -> None:
    facts = trigger_facts({"trigger": {"start": trigger(**start), "stop": trigger(**stop)}}, CLOCK)
    code = facts.get("time_code")
    assert (code and (code["label"], code["rate"], code["drop"], code["time_s"])) == expected
    assert facts["trigger"]["start"]["time_code"] == start.get("time_code", ""), "kept as it was sent"
