"""Recordings of the named gloves that go on now, and the time code of a line put on each of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from glovecal_client.clock import clock_s, computer_id, wall_ns
from glovecal_client.errors import ServiceError
from glovecal_client.rest import NoService
from glovecal_models.takes.time_code import TimeCode
from glovecal_service.plain import read
from glovecal_service.rest.glove.answer import Recording

if TYPE_CHECKING:
    from glovecal_client.rest import RestClient

UNAVAILABLE = 503


def is_away(error: ServiceError) -> bool:
    """Whether the service may answer later: nobody is there, or its database is busy."""
    return isinstance(error, NoService) or error.status == UNAVAILABLE


class OpenRecordings:
    def __init__(self, service: RestClient, gloves: Sequence[str]) -> None:
        self._service, self._gloves = service, set(gloves)

    def now(self) -> list[Recording]:
        """Those whose end nobody asked for. Raises ServiceError where the service does not answer."""
        rows = read(list[Recording], self._service.get("/recordings", {"only_open": True}))
        return [row for row in rows if row.glove in self._gloves and row.state in ("requested", "recording")]

    def note_time_code(self, row: Recording, code: TimeCode) -> None:
        """``code`` is by this computer's monotonic clock. Raises ServiceError."""
        ago_s = clock_s() - code.time_s
        running = {
            "time_code": code.label,
            "rate": code.rate,
            "source": code.source,
            "monotonic_s": code.time_s,
            "wall_s": wall_ns() / 1e9 - ago_s,
            "computer": computer_id(),
        }
        self._service.put(f"/recordings/{row.id}/time-code", running)


class TimeCodedRecordings:
    """``look`` again and again: each recording that begins gets what is on the line then, or as soon as it is
    there."""

    def __init__(
        self,
        recordings: OpenRecordings,
        time_code: Callable[[], TimeCode | None],
        *,
        tell: Callable[[str], None],
    ) -> None:
        """``time_code``: what runs now, by this computer's monotonic clock."""
        self._recordings, self._time_code, self._tell = recordings, time_code, tell
        self._noted: set[str] = set()
        self._waiting: set[str] = set()

    def look(self) -> None:
        """Raises ServiceError where the service does not answer."""
        rows = self._recordings.now()
        going_on = {row.id for row in rows}
        self._noted, self._waiting = self._noted & going_on, self._waiting & going_on
        for row in rows:
            if row.id not in self._noted:
                self._note(row)

    def _note(self, row: Recording) -> None:
        code = self._time_code()
        if code is not None:
            try:
                self._recordings.note_time_code(row, code)
            except ServiceError as error:
                if is_away(error):
                    raise
                self._tell(f"{row.name} ({row.glove}) keeps no time code: {error.detail or error.title}.")
            else:
                self._tell(f"{row.name} ({row.glove}): time code {code.at(clock_s())}.")
            self._noted.add(row.id)
        elif row.id not in self._waiting:
            self._waiting.add(row.id)
            self._tell(
                f"{row.name} ({row.glove}) has no time code yet: nothing is on the line. It gets what comes "
                "while it is recorded."
            )
