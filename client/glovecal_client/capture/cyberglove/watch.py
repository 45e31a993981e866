"""Watching a stream for the ways in which it ends without the port going away.

A cable pulled between the adapter and the box is plain silence; a glove pulled from its box gives error
records; a port taken over by something else gives garbage. Only time spent waiting counts, so a caller that
was busy elsewhere does not make the glove look lost.
"""

from __future__ import annotations

from collections import Counter

_NUDGE_S, _SILENT_S, _UNPLUGGED_S, _GARBAGE_S = 0.2, 0.4, 0.25, 2.0


class StreamWatch:
    """``period_s`` is the time between records; slow streams are given several of them."""

    def __init__(self, period_s: float) -> None:
        self._nudge_s = max(_NUDGE_S, 2.5 * period_s)
        self._silent_s = max(_SILENT_S, 5 * period_s)
        self._unplugged_s = max(_UNPLUGGED_S, 2.5 * period_s)
        self._garbage_s = max(_GARBAGE_S, 5 * period_s)
        self._silent_for_s = 0.0
        self._useless_for_s = 0.0
        self._errors: Counter[str] = Counter()
        self._errors_before: Counter[str] = Counter()
        self._nudged = False

    def note(self, waited_s: float, bytes_came: bool, records_came: bool, errors: Counter[str]) -> None:
        """After each wait: how long it was, what it brought, and the reader's error counts so far."""
        self._errors = errors
        self._silent_for_s = 0.0 if bytes_came else self._silent_for_s + waited_s
        if bytes_came:
            self._nudged = False
        if records_came:
            self._useless_for_s = 0.0
            self._errors_before = Counter(errors)
        else:
            self._useless_for_s += waited_s

    def should_nudge(self) -> bool:
        """True once per silence: time to apply the port's settings again and ask for the stream anew."""
        if self._nudged or self._silent_for_s < self._nudge_s:
            return False
        self._nudged = True
        return True

    def lost_because(self) -> str:
        """Why the stream counts as lost, empty while it does not."""
        if self._silent_for_s >= self._silent_s:
            return (
                f"no bytes for {self._silent_for_s:.1f} s: "
                "is the control box switched on and its cable plugged in?"
            )
        since = self._errors - self._errors_before
        if self._useless_for_s >= self._unplugged_s and (since["g"] or since["zero"]):
            return "the control box says that the glove is not plugged into it"
        if self._useless_for_s >= self._unplugged_s and since["s"]:
            return "the control box says that the sampling rate is too fast: give a lower rate"
        if self._useless_for_s >= self._garbage_s:
            return (
                f"only unreadable bytes for {self._useless_for_s:.1f} s: "
                "the baud rate has changed or another device took the port"
            )
        return ""
