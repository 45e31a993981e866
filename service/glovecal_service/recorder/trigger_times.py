"""When another system's triggers and time code came, by the clock of the take that they belong to."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from glovecal_models.errors import BadInput
from glovecal_models.takes.time_code import TimeCode
from glovecal_service.store.recordings import TRIGGER
from glovecal_service.store.records import TIME_CODE


def trigger_facts(recording: Mapping[str, Any], clock: Mapping[str, Any]) -> dict[str, Any]:
    """Facts of the take of a recording with these facts: its triggers with ``time_s``, and a time code.

    ``clock`` is ``RecordedTake.clock``. A trigger that came to the capture computer has its time exactly;
    one that came to another computer as exactly as both tell the time of day. The time code is that which
    was heard on a line, else the start's, else the stop's; one without a frame rate is kept as it was sent,
    and is none of the take.
    """
    triggers = {
        action: {**trigger, **_time_of(trigger, clock)}
        for action, trigger in recording.get(TRIGGER, {}).items()
    }
    running = recording.get(TIME_CODE)
    sources = [] if running is None else [{**running, **_time_of(running, clock)}]
    sources += [triggers[action] for action in ("start", "stop") if action in triggers]
    known = [code for code in map(_time_code, sources) if code is not None]
    return ({TRIGGER: triggers} if triggers else {}) | ({TIME_CODE: known[0].document()} if known else {})


def _time_of(trigger: Mapping[str, Any], clock: Mapping[str, Any]) -> dict[str, Any]:
    is_same = trigger["computer"] == clock["computer"]
    arrived_s = trigger["monotonic_s"] if is_same else trigger["wall_s"] - clock["wall_minus_time_s"]
    return {"time_s": arrived_s + trigger.get("delay_s", 0.0), "clock": "monotonic" if is_same else "wall"}


def _time_code(came: Mapping[str, Any]) -> TimeCode | None:
    source = came["source"] if "source" in came else f"trigger ({came['protocol']})"
    try:
        return TimeCode.of_text(came["time_code"], came["rate"], came["time_s"], source)
    except BadInput:
        return None
