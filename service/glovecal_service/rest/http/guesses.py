"""Guessing of passwords is slowed: by name, by address, and for all together.

A name is slowed for whoever guesses it, and so is an address; each is let through now and then, so that
nobody is locked out for long. From where somebody's password was right before, their name is not slowed by
what strangers guess. Names that there are not are slowed like the others. All of it is forgotten with the
process.
"""

from __future__ import annotations

import time
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass, field
from ipaddress import IPv6Address, ip_address
from typing import TypeVar

import anyio
from anyio.to_thread import run_sync

from glovecal_service.rest.http.pauses import MOST_REMEMBERED, Pauses, too_early
from glovecal_service.rest.http.problem import Problem

AT_ONCE = 10
"""Wrong passwords of a name, and of an address, before the first pause."""
NAME_PAUSE_S, ADDRESS_PAUSE_S = 5.0, 30.0
"""Between two more."""
CHECKED_AT_ONCE = 2
"""Each takes a processor and 64 MiB."""
MOST_WAITING = 20
IPV6_NETWORK_BITS = 64
"""What one subscriber has."""
Answer = TypeVar("Answer")


@dataclass
class Guesses:
    """For the event loop's thread."""

    clock: Callable[[], float] = time.monotonic
    _slots: anyio.CapacityLimiter = field(default_factory=lambda: anyio.CapacityLimiter(CHECKED_AT_ONCE))
    _usual: OrderedDict[tuple[str, str], None] = field(default_factory=OrderedDict)
    """Names and the addresses where their passwords were right."""
    _inside: int = 0
    """Passwords that are checked, or wait for it."""

    def __post_init__(self) -> None:
        self._names = Pauses(NAME_PAUSE_S, AT_ONCE, self.clock)
        self._addresses = Pauses(ADDRESS_PAUSE_S, AT_ONCE, self.clock)

    async def check(self, name: str, address: str, ask: Callable[[], Answer | None]) -> Answer | None:
        """What ``ask`` finds in a thread, None for a wrong password. Raises Problem 429 where it is too early
        for one more guess, and 503 where too many wait."""
        network = _network(address)
        is_usual = (name, network) in self._usual
        counted = [(self._addresses, network)] + ([] if is_usual else [(self._names, name)])
        wait_s = max(pauses.wait_s(who) for pauses, who in counted)
        if wait_s > 0.0:
            raise too_early(
                wait_s,
                "too-many-guesses",
                "Too many wrong passwords of this name or from this address; try again in {seconds} s.",
            )
        self._require_room()
        for pauses, who in counted:  # before it is known: many at once would all be let through
            pauses.count(who)
        answer = await self.in_turn(ask)
        if answer is not None:
            for pauses, who in counted:
                pauses.take_back(who)
            self._usual[name, network] = None
            self._usual.move_to_end((name, network))
            if len(self._usual) > MOST_REMEMBERED:
                self._usual.popitem(last=False)
        return answer

    async def in_turn(self, work: Callable[[], Answer]) -> Answer:
        """Work with a password, in a thread, a few at once. Raises Problem 503 where too many wait."""
        self._require_room()
        self._inside += 1
        try:
            return await run_sync(work, limiter=self._slots)
        finally:
            self._inside -= 1

    def _require_room(self) -> None:
        if self._inside >= CHECKED_AT_ONCE + MOST_WAITING:
            raise Problem(
                503,
                "too-many-logins",
                "Too many passwords are being checked at this moment; try again in some seconds.",
                headers={"Retry-After": "5"},
            )


def _network(address: str) -> str:
    """The address; of IPv6 the part that one subscriber has."""
    try:
        known = ip_address(address.partition("%")[0])
    except ValueError:
        return address
    if not isinstance(known, IPv6Address):
        return str(known)
    if known.ipv4_mapped is not None:
        return str(known.ipv4_mapped)
    return known.exploded.replace(":", "")[: IPV6_NETWORK_BITS // 4]
