"""Begins and ends recordings of gloves as triggers ask for it, over the service's REST."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from glovecal_client.clock import clock_s, computer_id
from glovecal_client.errors import ServiceError
from glovecal_models.errors import BadInput
from glovecal_models.takes.time_code import TimeCode
from glovecal_service.plain import read
from glovecal_service.recorder.triggers.listener import Arrival
from glovecal_service.recorder.triggers.open_recordings import OpenRecordings, is_away
from glovecal_service.recorder.triggers.trigger import safe_name
from glovecal_service.rest.glove.answer import Recording
from glovecal_service.rest.take.answer import Take

if TYPE_CHECKING:
    from glovecal_client.rest import RestClient

SETTLED_WITHIN_S = 10.0
"""An earlier recording of the glove makes its account first."""
BEGINS_WITHIN_S = 10.0
LOOK_EVERY_S = 0.02
COUNTED_ON_S = 600.0
"""A trigger's time code is counted on so long: 60 ms off then, where quartzes differ by 100 ppm."""
CONFLICT = 409
TRIGGER, START = "trigger", "start"
"""Facts of a recording that a trigger began."""


class TriggeredRecordings:
    """Of the gloves named. What goes on is asked of the service each time, so that a process that was
    started again ends what another one began; recordings that a person began are left alone."""

    def __init__(
        self,
        service: RestClient,
        gloves: Sequence[str],
        *,
        tell: Callable[[str], None],
        rate: str | None = None,
        pre_roll_s: float = 60.0,
    ) -> None:
        """``rate``: of the time codes in triggers, a name of ``glovecal_models.takes.time_code.RATES``."""
        self._service, self._gloves, self._tell = service, list(gloves), tell
        self._rate, self._pre_roll_s = rate, pre_roll_s
        self._open = OpenRecordings(service, gloves)
        self._time_code: TimeCode | None = None

    @property
    def time_code(self) -> TimeCode | None:
        """Of the last trigger that had one, while its quartz and ours agree: by this computer's monotonic
        clock."""
        code = self._time_code
        return None if code is None or clock_s() - code.time_s > COUNTED_ON_S else code

    def _sent_time_code(self, arrival: Arrival) -> TimeCode | None:
        trigger = arrival.trigger
        begins_s = arrival.monotonic_s + trigger.delay_s
        try:
            return TimeCode.of_text(trigger.time_code, self._rate, begins_s, _from(arrival))
        except BadInput:
            return None

    def carry_out(self, arrival: Arrival) -> bool:
        """Whether it was; what came of it is told. Raises ServiceError where the service does not answer."""
        self._time_code = self._sent_time_code(arrival) or self._time_code
        if arrival.trigger.action == "start":
            return self._start(arrival)
        return self._stop(arrival)

    def _start(self, arrival: Arrival) -> bool:
        wanted, going_on = arrival.trigger.name, self._going_on()
        if going_on and all(_sent_name(one) == wanted for one in going_on):
            return self._complete(arrival, going_on)
        if going_on:
            self._tell(f"{_from(arrival)}: no end of {going_on[0].name} came; it ends as the next begins.")
            for one in going_on:
                self._service.post(f"/recordings/{one.id}/stop")
        return self._begin(arrival, self._free_name(wanted), self._gloves)

    def _complete(self, arrival: Arrival, going_on: Sequence[Recording]) -> bool:
        """The same start once more: begin those that could not be recorded the first time."""
        name, recorded = going_on[0].name, {one.glove for one in going_on}
        missing = [glove for glove in self._gloves if glove not in recorded]
        if not missing:
            self._tell(f"{_from(arrival)}: {name} is being recorded already.")
            return True
        return self._begin(arrival, name, missing)

    def _begin(self, arrival: Arrival, name: str, gloves: Sequence[str]) -> bool:
        document = {"name": name, "lead_s": self._pre_roll_s, "trigger": self._document(arrival)}
        begun = [one for glove in gloves if (one := self._request(glove, document)) is not None]
        begun = [one for one in begun if self._is_taken_on(one)]
        if begun:
            recorded = " and ".join(one.glove for one in begun)
            renamed = _renamed(arrival.trigger.name, name)
            self._tell(f"{_from(arrival)}: recording {name} of {recorded}.{renamed}")
        return bool(begun)

    def _stop(self, arrival: Arrival) -> bool:
        going_on = self._going_on()
        if not going_on:
            self._tell(f"{_from(arrival)}: the end of a recording, but no trigger began one here.")
            return False
        wanted, name = arrival.trigger.name, going_on[0].name
        body: dict[str, Any] = {"trigger": self._document(arrival)}
        if wanted and wanted != _sent_name(going_on[0]):
            name = body["name"] = self._free_name(wanted)
        for one in going_on:
            self._service.post(f"/recordings/{one.id}/stop", body)
        result = {"FAIL": " The sender calls it failed.", "CANCEL": " The sender calls it cancelled."}
        renamed = _renamed(wanted, name) if "name" in body else ""
        self._tell(f"{_from(arrival)}: end of {name}.{renamed}{result.get(arrival.trigger.result, '')}")
        return True

    def _going_on(self) -> list[Recording]:
        """Those of our gloves that a trigger began and nobody ended."""
        return [row for row in self._open.now() if TRIGGER in row.facts]

    def _request(self, glove: str, document: dict[str, Any]) -> Recording | None:
        """None where the glove cannot be recorded, which is told."""
        until = time.monotonic() + SETTLED_WITHIN_S
        while True:
            try:
                return read(Recording, self._service.post("/recordings", {"glove": glove, **document}))
            except ServiceError as error:
                if error.status == CONFLICT and self._is_settling(glove) and time.monotonic() < until:
                    time.sleep(LOOK_EVERY_S)
                    continue
                if is_away(error):
                    raise
                self._tell(f"Glove {glove} is not recorded: {error.detail or error.title}.")
                return None

    def _is_settling(self, glove: str) -> bool:
        rows = read(list[Recording], self._service.get("/recordings", {"only_open": True, "glove": glove}))
        return all(row.state == "stopping" for row in rows)

    def _is_taken_on(self, one: Recording) -> bool:
        until = time.monotonic() + BEGINS_WITHIN_S
        while read(Recording, self._service.get(f"/recordings/{one.id}")).state == "requested":
            if time.monotonic() > until:
                self._service.post(f"/recordings/{one.id}/stop")
                self._tell(
                    f"Glove {one.glove} is not recorded: no recorder began within {BEGINS_WITHIN_S:g} s; is "
                    "glovecal serve running on this data folder?"
                )
                return False
            time.sleep(LOOK_EVERY_S)
        return True

    def _free_name(self, wanted: str) -> str:
        """``wanted`` as a take can be called, with a number where a take or an open recording has it."""
        name = safe_name(wanted)
        takes = read(list[Take], self._service.get("/takes", {"text": name}))
        recordings = read(list[Recording], self._service.get("/recordings", {"only_open": True}))
        taken = {row.name.casefold() for row in [*takes, *recordings]}
        number, free = 1, name
        while free.casefold() in taken:
            number += 1
            free = f"{name}-{number}"
        return free

    def _document(self, arrival: Arrival) -> dict[str, Any]:
        trigger = arrival.trigger
        return {
            "protocol": arrival.protocol,
            "sender": arrival.sender,
            "name": trigger.name,
            "notes": trigger.notes,
            "description": trigger.description,
            "result": trigger.result,
            "time_code": trigger.time_code,
            "rate": self._rate,
            "delay_s": trigger.delay_s,
            "monotonic_s": arrival.monotonic_s,
            "wall_s": arrival.wall_s,
            "computer": computer_id(),
        }


def _sent_name(one: Recording) -> str:
    return str(one.facts[TRIGGER][START]["name"])


def _from(arrival: Arrival) -> str:
    return f"{arrival.protocol} ({arrival.sender})"


def _renamed(wanted: str, name: str) -> str:
    if not wanted or wanted == name:
        return ""
    why = "" if safe_name(wanted) != wanted else ", which is taken"
    return f" The trigger says {wanted!r}{why}."
