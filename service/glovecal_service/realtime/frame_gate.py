"""Which frames of one glove may go on to a model: whole, finite, in order, from one publisher."""

from __future__ import annotations

from glovecal_client.errors import WireError
from glovecal_client.wire.frame import Frame, decode_frame
from glovecal_service.realtime.refusal import Refusal, Refused

TAKEOVER_AFTER_NS = 500_000_000
"""A publisher keeps its glove until it was silent this long; then another run may take it over."""

_VERSION_AT = 4
_KNOWN_VERSION = 1


class FrameGate:
    """Lets the frames of one glove pass or raises Refused; ``run_id`` and ``sequence`` tell where it stands.

    Sequence numbers must grow within a run. A clock that stepped back costs the frame at the step, not
    all that follow. Another run may begin after the present one was silent for half a second.
    """

    def __init__(self) -> None:
        self.run_id: int | None = None
        self.sequence = -1
        self.runs = 0
        """How many runs began so far; grows when another publisher takes over."""
        self._monotonic_ns = 0
        self._passed_at_ns = 0

    def pass_frame(self, message: bytes, received_ns: int) -> Frame:
        """The frame in ``message``, received at ``received_ns`` of this process' monotonic clock."""
        frame = _decode(message)
        silent = received_ns - self._passed_at_ns > TAKEOVER_AFTER_NS
        if frame.run_id != self.run_id:
            self._check_takeover(frame, silent)
        else:
            self._check_order(frame)
        if frame.run_id != self.run_id:
            self.runs += 1
        self.run_id, self.sequence = frame.run_id, frame.sequence
        self._monotonic_ns, self._passed_at_ns = frame.monotonic_ns, received_ns
        return frame

    def _check_takeover(self, frame: Frame, silent: bool) -> None:
        if self.run_id is not None and not silent:
            raise Refused(
                Refusal.SECOND_PUBLISHER,
                f"run {frame.run_id:016x} publishes while run {self.run_id:016x} has the glove; stop one",
            )

    def _check_order(self, frame: Frame) -> None:
        if frame.sequence == self.sequence:
            raise Refused(Refusal.DUPLICATE, f"sequence number {frame.sequence} came twice")
        if frame.sequence < self.sequence:
            raise Refused(
                Refusal.SEQUENCE_BACKWARDS,
                f"sequence number {frame.sequence} came after {self.sequence}",
            )
        if frame.monotonic_ns <= self._monotonic_ns:
            before, self._monotonic_ns, self.sequence = (
                self._monotonic_ns, frame.monotonic_ns, frame.sequence
            )  # fmt: skip
            raise Refused(
                Refusal.TIME_BACKWARDS,
                f"frame {frame.sequence} went back in time by {(before - frame.monotonic_ns) / 1e9:.6f} s",
            )


def _decode(message: bytes) -> Frame:
    try:
        return decode_frame(message)
    except WireError as error:
        raise Refused(_reason(message, error), str(error)) from error


def _reason(message: bytes, error: WireError) -> Refusal:
    if (
        message[:_VERSION_AT] == b"GLVF"
        and len(message) > _VERSION_AT
        and message[_VERSION_AT] != _KNOWN_VERSION
    ):
        return Refusal.UNKNOWN_VERSION
    # the format refuses numbers only after it has found the message whole and its checksum right
    return Refusal.NOT_FINITE if "finite" in str(error) else Refusal.DAMAGED
