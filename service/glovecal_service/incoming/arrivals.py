"""Messages from zenoh's receive thread to one of ours, without ever making zenoh wait.

A callback that blocks, or a FIFO channel that fills, stalls everything else on its link; a callback of ours
that does not block still has to get Python's lock for each message, from the very thread that predicts. So
messages wait in a ring channel, outside of Python, until ``wait`` or ``drain`` takes them. Where a reader
stands still for so long that the ring overflows, the oldest go: they are missing in the sequence numbers.
"""

from __future__ import annotations

import secrets
from threading import Event, Thread
from typing import NamedTuple

import zenoh

from glovecal_client.clock import clock_ns, wall_ns

ARRIVALS_LIMIT = 8192
"""Messages waiting at most; at 64 gloves and 120 Hz that is one second of a reader that stands still."""
LONGEST_WAIT_S = 0.1


class Arrival(NamedTuple):
    """One message as it came."""

    key: str
    payload: bytes
    received_ns: int
    """``clock_ns()`` when zenoh received the message."""


class Arrivals:
    """A subscription whose messages wait until ``wait`` or ``drain`` takes them; for one reading thread."""

    def __init__(self, session: zenoh.Session, key_expression: str, *, limit: int = ARRIVALS_LIMIT) -> None:
        self.left_out: set[str] = set()
        """Keys whose messages are thrown away unread."""
        self._session = session
        self._limit = limit
        self._clock_id = str(session.zid())
        self._looked_ns = clock_ns()
        self._closed = Event()
        self._left: list[Arrival] = []
        self._alarm: Thread | None = None
        self._alarm_key = key_expression.replace("*", "ALARM")  # no glove can have this name
        self._alarm_payload = secrets.token_bytes(16)
        self._subscriber = session.declare_subscriber(key_expression, zenoh.handlers.RingChannel(limit))

    def wait(self) -> Arrival | None:
        """The next message, or None when none came within a tenth of a second."""
        if self._alarm is None:
            self._alarm = Thread(target=self._sound_alarms, name="alarm", daemon=True)
            self._alarm.start()
        sample = self._subscriber.recv()
        self._looked_ns = clock_ns()
        payload = sample.payload.to_bytes()
        if payload == self._alarm_payload:
            return None
        return Arrival(str(sample.key_expr), payload, self._looked_ns)

    def drain(self) -> list[Arrival]:
        """All messages that are waiting, oldest first; does not wait."""
        if self._closed.is_set():
            left, self._left = self._left, []
            return left
        return self._take()

    def _take(self) -> list[Arrival]:
        samples: list[zenoh.Sample] = []
        receive = self._subscriber.try_recv
        while len(samples) < self._limit and (sample := receive()) is not None:
            samples.append(sample)
        looked_ns, now_ns = self._looked_ns, clock_ns()
        self._looked_ns = now_ns
        if not samples:
            return []
        wall_less_monotonic_ns = wall_ns() - now_ns
        taken: list[Arrival] = []
        for sample in samples:
            key = str(sample.key_expr)
            if key in self.left_out:
                continue
            payload = sample.payload.to_bytes()
            if payload != self._alarm_payload:
                received_ns = (
                    self._stamped_ns(sample, now_ns + wall_less_monotonic_ns) - wall_less_monotonic_ns
                )
                # whatever a stamp says, it came after the look before and is here now
                received_ns = min(max(received_ns, looked_ns), now_ns)
                taken.append(Arrival(key, payload, received_ns))
        return taken

    def _stamped_ns(self, sample: zenoh.Sample, now_ns: int) -> int:
        """When the router received the message, in wall time; ``now_ns`` where it is not of this process."""
        stamp = sample.timestamp
        if stamp is None or str(stamp.get_id()) != self._clock_id:
            return now_ns
        return int(stamp.get_time().timestamp() * 1e9)

    def _sound_alarms(self) -> None:
        """zenoh's channels cannot be waited for with a limit of time; this ends the wait."""
        while not self._closed.wait(LONGEST_WAIT_S):
            self._session.put(
                self._alarm_key, self._alarm_payload, allowed_destination=zenoh.Locality.SESSION_LOCAL
            )

    def close(self) -> None:
        """Stop receiving; what waits can still be drained.

        Not while another thread waits: its ``wait`` would raise zenoh.ZError.
        """
        if self._closed.is_set():
            return
        self._left = self._take()  # zenoh throws its ring away
        self._closed.set()
        if self._alarm is not None:
            self._alarm.join()
        self._subscriber.undeclare()
