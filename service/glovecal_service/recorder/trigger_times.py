"""When another system's triggers came, by the clock of the take that they began and ended."""

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
    one that came to another computer as exactly as both tell the time of day. The time code is the start's,
    else the stop's; one without a frame rate is kept as it was sent, and is none of the take.
    """
    triggers = {
        action: {**trigger, **_time_of(trigger, clock)}
        for action, trigger in recording.get(TRIGGER, {}).items()
    }
    if not triggers:
        return {}
    codes = [_time_code(triggers[action]) for action in ("start", "stop") if action in triggers]
    known = [code for code in codes if code is not None]
    return {TRIGGER: triggers} | ({TIME_CODE: known[0].document()} if known else {})


def _time_of(trigger: Mapping[str, Any], clock: Mapping[str, Any]) -> dict[str, Any]:
    is_same = trigger["computer"] == clock["computer"]
    arrived_s = trigger["monotonic_s"] if is_same else trigger["wall_s"] - clock["wall_minus_time_s"]
    return {"time_s": arrived_s + trigger["delay_s"], "clock": "monotonic" if is_same else "wall"}


def _time_code(trigger: Mapping[str, Any]) -> TimeCode | None:
    try:
        return TimeCode.of_text(
            trigger["time_code"], trigger["rate"], trigger["time_s"], f"trigger ({trigger['protocol']})"
        )
    except BadInput:
        return None
