"""Listens for triggers on UDP ports: only from senders that may, each once, and everything else counted."""

from __future__ import annotations

import ipaddress
import socket
import time
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from queue import Full, Queue
from threading import Event, Lock, Thread
from typing import Any

from glovecal_client.clock import clock_ns, wall_ns
from glovecal_client.hosts import is_loopback
from glovecal_models.errors import BadInput
from glovecal_service.recorder.triggers.formats import Endpoint
from glovecal_service.recorder.triggers.trigger import Reader, Request, Trigger, UnknownPacket

RECEIVED_AT_MOST = 65_536
LOOK_EVERY_S = 0.2
REPEATED_WITHIN_S = 60.0
MOST_REMEMBERED = 256
MOST_WAITING = 64
HIGHER_PORT = 1512
Senders = Sequence[ipaddress.IPv4Network | ipaddress.IPv6Network]


@dataclass(frozen=True)
class Arrival:
    """A trigger, when it came, and how its sender is answered."""

    trigger: Trigger
    protocol: str
    sender: str
    monotonic_s: float
    """Seconds of this computer's monotonic clock."""
    wall_s: float
    """Seconds since 1970."""
    answer: Callable[[bool], None]
    """Call it with whether the trigger was carried out."""


@dataclass
class Counts:
    """Packets by what became of them; reasons in words."""

    triggers: int = 0
    other: int = 0
    """Understood, and nothing to begin or end: names, settings."""
    repeated: int = 0
    own: int = 0
    """Sent by this very process."""
    dropped: int = 0
    """Triggers that came while too many were waiting."""
    unknown: Counter[str] = field(default_factory=Counter)
    refused_senders: Counter[str] = field(default_factory=Counter)

    @property
    def sentence(self) -> str:
        parts = [f"{self.triggers} triggers"]
        parts += [f"{self.repeated} repeated"] if self.repeated else []
        parts += [f"{sum(self.unknown.values())} unknown packets"] if self.unknown else []
        refused = sum(self.refused_senders.values())
        parts += [f"{refused} packets of senders that are not in --from"] if refused else []
        parts += [f"{self.dropped} dropped: too many at once"] if self.dropped else []
        return ", ".join(parts)


def senders_of(texts: Sequence[str]) -> Senders:
    """Addresses and networks such as ``192.168.1.0/24``. Raises BadInput."""
    networks = []
    for text in texts:
        try:
            networks.append(ipaddress.ip_network(text, strict=False))
        except ValueError:
            raise BadInput(
                f"--from {text[:60]!r} is no address or network; write it like 192.168.1.5 or 192.168.1.0/24"
            ) from None
    return networks


class Listener:
    """One socket and one thread for each endpoint; triggers come out of ``arrivals`` in their order."""

    def __init__(
        self,
        endpoints: Sequence[Endpoint],
        senders: Senders,
        *,
        is_own: Callable[[int, bytes], bool] = lambda port, packet: False,
        tell: Callable[[str], None],
    ) -> None:
        """``is_own``: whether this process sent the packet, from a port. Raises BadInput for what cannot be
        listened on, or is open to everybody."""
        self.arrivals: Queue[Arrival] = Queue(MOST_WAITING)
        self.counts = Counts()
        self._senders, self._is_own, self._tell = senders, is_own, tell
        self._remembered: dict[tuple[str, str, str], float] = {}
        self._remembering = Lock()
        self._stopped = Event()
        self._sockets: list[socket.socket] = []
        try:
            for endpoint in endpoints:
                self._sockets.append(self._opened(endpoint))
        except BaseException:
            self.close()
            raise
        self.ports = [opened.getsockname()[1] for opened in self._sockets]
        self._threads = [
            Thread(target=self._listen, args=(opened, endpoint), name=str(endpoint), daemon=True)
            for opened, endpoint in zip(self._sockets, endpoints, strict=True)
        ]
        for thread in self._threads:
            thread.start()

    def _opened(self, endpoint: Endpoint) -> socket.socket:
        if not self._senders and not is_loopback(endpoint.host):
            raise BadInput(
                f"{endpoint} is open to other computers: name who may begin and end recordings with "
                "--from, an address or a network such as 192.168.1.0/24"
            )
        opened = socket.socket(socket.AF_INET6 if ":" in endpoint.host else socket.AF_INET, socket.SOCK_DGRAM)
        try:
            opened.settimeout(LOOK_EVERY_S)
            opened.bind((endpoint.host, endpoint.port))
        except OSError as error:
            opened.close()
            raise BadInput(
                f"cannot listen on {endpoint}: {error.strerror or 'no such address'}. Ports below 1024 may "
                f"need rights: have the system send to another one, as in {endpoint.protocol}:{HIGHER_PORT}"
            ) from error
        return opened

    def close(self) -> None:
        self._stopped.set()
        for thread in getattr(self, "_threads", ()):
            thread.join()
        for opened in self._sockets:
            opened.close()

    def _listen(self, opened: socket.socket, endpoint: Endpoint) -> None:
        reader = endpoint.form.reader()
        while not self._stopped.is_set():
            try:
                packet, sender = opened.recvfrom(RECEIVED_AT_MOST)
            except TimeoutError:
                continue
            except OSError:  # an answer that nobody took comes back as an error of the next call
                continue
            monotonic_s, wall_s = clock_ns() / 1e9, wall_ns() / 1e9
            if not self._may_send(sender[0]):
                self._note_refused(sender[0])
            elif self._is_own(sender[1], packet):
                self.counts.own += 1
            else:
                self._take(opened, endpoint, reader, packet, sender, (monotonic_s, wall_s))

    def _may_send(self, host: str) -> bool:
        address = ipaddress.ip_address(host.partition("%")[0])
        return address.is_loopback or any(address in network for network in self._senders)

    def _note_refused(self, host: str) -> None:
        known = self.counts.refused_senders
        if host in known or len(known) < MOST_REMEMBERED:
            known[host] += 1
        if known[host] == 1:
            self._tell(f"Ignored a packet of {host}: it is not in --from.")

    def _take(
        self,
        opened: socket.socket,
        endpoint: Endpoint,
        reader: Reader,
        packet: bytes,
        sender: Any,
        at: tuple[float, float],
    ) -> None:
        try:
            request: Request = reader.read(packet)
        except UnknownPacket as error:
            self._note_unknown(endpoint, sender[0], str(error))
            return

        def answer(is_done: bool) -> None:
            reply = request.when_done if is_done else request.when_refused
            if reply:
                place = (sender[0], request.answer_port or sender[1], *sender[2:])
                try:
                    opened.sendto(reply, place)
                except OSError:
                    self._tell(f"{endpoint.protocol}: {sender[0]} could not be answered.")

        trigger = request.trigger
        if trigger is None:
            self.counts.other += 1
            answer(True)
        elif self._is_repeated(trigger):
            self.counts.repeated += 1
            answer(True)
        else:
            try:
                self.arrivals.put_nowait(Arrival(trigger, endpoint.protocol, sender[0], at[0], at[1], answer))
                self.counts.triggers += 1
            except Full:
                self.counts.dropped += 1

    def _note_unknown(self, endpoint: Endpoint, host: str, why: str) -> None:
        known = self.counts.unknown
        key = why if why in known or len(known) < MOST_REMEMBERED else "others"
        known[key] += 1
        if known[key] == 1:
            self._tell(f"{endpoint.protocol}: ignored a packet of {host}: {why}.")

    def _is_repeated(self, trigger: Trigger) -> bool:
        """Systems send a packet several times, by every network card, under one number."""
        if not trigger.packet_id:
            return False
        now = time.monotonic()
        key = (trigger.action, trigger.name, trigger.packet_id)
        with self._remembering:  # a system's packets may come in on two ports
            before = self._remembered.pop(key, None)
            self._remembered[key] = now
            while len(self._remembered) > MOST_REMEMBERED:
                del self._remembered[next(iter(self._remembered))]
        return before is not None and now - before < REPEATED_WITHIN_S
