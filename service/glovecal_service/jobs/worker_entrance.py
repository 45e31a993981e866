"""Where workers on other computers come in, at a site with certificates.

Dask unpickles what it is sent, so its scheduler stays on loopback, and nobody reaches it but through here:
who shows a certificate of the site that is a worker's, was not revoked and has not expired, and has the
service's code. A capture's or a viewer's certificate is refused before anything is read. What is said is in
``worker_talk.py``.
"""

from __future__ import annotations

import asyncio
import logging
import secrets
import ssl
import threading
from collections.abc import Awaitable, Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import Any

from glovecal_client.errors import ClientError, reason_of
from glovecal_client.site.certificates import check_certificate, common_name_in, load_key, peer_context
from glovecal_client.site.member import Member, read_member
from glovecal_models.errors import BadInput
from glovecal_service.jobs.code_identity import code_identity, difference
from glovecal_service.jobs.worker_talk import GREETED_WITHIN_S, SCHEDULER, WORK, Gone, Line, pass_on
from glovecal_service.jobs.workers import Invitation, Workers, WorkersLost
from glovecal_service.settings import Settings
from glovecal_service.store.site.site_folder import Row, SiteFolder

LOOK_EVERY_S = 0.5
ENDS_WITHIN_S = 20.0
_log = logging.getLogger("glovecal.jobs")


class Refused(Exception):
    """Why somebody is not let in, for a person on either side."""


@dataclass(eq=False)
class Guest:
    """A worker that was let in, with all its connections."""

    row: Row
    invitation: Invitation
    line: Line
    tunnels: set[Line] = field(default_factory=set)

    def close(self) -> None:
        for line in (self.line, *self.tunnels):
            line.close()


class WorkerEntrance:
    """``start()`` once, ``stop()`` once. Runs in a thread of its own."""

    def __init__(self, settings: Settings, workers: Workers) -> None:
        assert settings.site_file is not None
        self._settings = settings
        self._file = settings.site_file
        self._folder = SiteFolder(settings.data)
        self._workers = workers
        self._member: Member | None = None
        self._context: ssl.SSLContext | None = None
        self._admitted: Mapping[str, Row] = {}
        self._guests: dict[str, Guest] = {}
        """By the word that lets a guest's further connections in."""
        self._keyholders: dict[str, Invitation] = {}
        """By common name; also of those who have gone again."""
        self._taken_in = 0
        self._complaint = ""
        code_identity()  # while it is that of what this process has imported
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name="worker-entrance", daemon=True)

    @property
    def has_guests(self) -> bool:
        """Whether workers are there, or about to be: the scheduler has to stay for them."""
        return self._taken_in > 0

    def start(self) -> None:
        self._thread.start()

    def stop(self) -> None:
        self._stopping.set()
        if self._thread.ident is not None:
            self._thread.join(ENDS_WITHIN_S)

    def _run(self) -> None:
        asyncio.run(self._serve())

    async def _serve(self) -> None:
        server: asyncio.Server | None = None
        while not self._stopping.is_set():
            self._look()
            await self._dismiss_unwelcome()
            if self._admitted and server is None and self._context is not None:
                server = await self._opened(self._context)
            elif not self._admitted and server is not None:
                server.close()
                server = None
            await asyncio.sleep(LOOK_EVERY_S)
        if server is not None:
            server.close()
        for guest in list(self._guests.values()):
            guest.close()

    async def _opened(self, context: ssl.SSLContext) -> asyncio.Server | None:
        host, port = self._settings.host, self._settings.worker_port
        try:
            server = await asyncio.start_server(
                self._meet, host, port, ssl=context, ssl_handshake_timeout=GREETED_WITHIN_S
            )
        except OSError as error:
            self._complain(f"none can come in at {host}, port {port}: {reason_of(error)}")
            return None
        _log.info("workers on other computers are let in at port %d", port)
        return server

    def _look(self) -> None:
        """Who belongs to the site now, and with which certificate the service shows itself."""
        try:
            self._admitted = self._folder.register().workers(datetime.now(UTC))
            member = read_member(self._file)
            if member != self._member:
                check_certificate(member)
                if self._context is None:
                    self._context = peer_context(member)
                else:
                    load_key(self._context, member)
                self._member = member
        except (ClientError, BadInput) as error:
            self._complain(str(error))
        except OSError as error:  # of ssl, too
            self._complain(f"none can come in: {reason_of(error)}")

    async def _dismiss_unwelcome(self) -> None:
        for guest in list(self._guests.values()):
            if guest.row.common_name not in self._admitted:
                with suppress(Gone):
                    await guest.line.say(refused=_refusal("worker"))
                await guest.line.end()
                guest.close()
            elif not self._workers.is_current(guest.invitation):
                guest.close()
        for name in self._keyholders.keys() - self._admitted.keys():
            invitation = self._keyholders.pop(name)
            await asyncio.to_thread(
                self._workers.reset, invitation.client
            )  # with that, its keys open nothing

    def _complain(self, sentence: str) -> None:
        """Once, not every half second."""
        if sentence != self._complaint:
            self._complaint = sentence
            _log.warning("workers on other computers: %s", sentence)

    async def _meet(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        line = Line(reader, writer)
        try:
            row = self._admit(writer.get_extra_info("peercert") or {})
            words = await line.hear(GREETED_WITHIN_S)
            self._compare(row, words.get("code"))
            if words.get("wants") == WORK:
                await self._take_in(row, line)
            elif words.get("wants") == SCHEDULER:
                await self._connect(row, line, str(words.get("guest")))
        except Refused as refusal:
            self._workers.refusal = str(refusal)
            self._complain(f"one was refused: {refusal}")
            with suppress(Gone):
                await line.say(refused=str(refusal))
            await line.end()
        except WorkersLost as error:
            with suppress(Gone):
                await line.say(later=str(error))
            await line.end()
        except (Gone, asyncio.CancelledError):  # the latter when the service stops: asyncio would log it
            pass
        finally:
            line.close()

    def _admit(self, certificate: Mapping[str, Any]) -> Row:
        """Raises Refused."""
        name = common_name_in(certificate)
        row = self._admitted.get(name)
        if row is None:
            raise Refused(_refusal(name.rpartition(".")[0].removeprefix("bound-")))
        return row

    def _compare(self, row: Row, code: Any) -> None:
        """Raises Refused."""
        theirs = code if isinstance(code, dict) else {}
        other = difference(code_identity(), {str(name): str(value) for name, value in theirs.items()})
        if other is not None:
            raise Refused(
                f"{row.name} has other code than the service, so its results would not be the same: {other}. "
                f"Install glovecal {code_identity()['glovecal']} and these packages there as they are at the "
                "service, and start it again"
            )

    async def _take_in(self, row: Row, line: Line) -> None:
        """Raises Gone, WorkersLost."""
        saying = asyncio.create_task(_until_gone(line.say_alive))  # the scheduler may take long to start
        word = secrets.token_hex(16)
        self._taken_in += 1
        try:
            invitation = await asyncio.to_thread(self._workers.invite)
            guest = self._guests[word] = Guest(row, invitation, line)
            self._keyholders[row.common_name] = invitation
            await line.say(guest=word, keys=invitation.keys)
            _log.info("worker %s came", row.name)
            await _until_gone(line.hear)
        finally:
            self._taken_in -= 1
            saying.cancel()
            guest = self._guests.pop(word, None)
            if guest is not None:
                guest.close()
                _log.info("worker %s went", row.name)

    async def _connect(self, row: Row, line: Line, word: str) -> None:
        """Raises Gone."""
        guest = self._guests.get(word)
        if guest is None or guest.row != row:
            raise Gone
        try:
            scheduler = Line(*await asyncio.open_connection("127.0.0.1", guest.invitation.port))
        except OSError as error:
            raise Gone from error
        guest.tunnels.add(line)
        try:
            await line.say(connected=True)
            await pass_on(line, scheduler)
        finally:
            guest.tunnels.discard(line)
            scheduler.close()


def _refusal(kind: str) -> str:
    why = "was revoked, or has expired" if kind == "worker" else f"is that of a {kind}, which may not train"
    return f"the file of this computer {why}; make one at the service: glovecal site add NAME --as worker"


async def _until_gone(act: Callable[[], Awaitable[object]]) -> None:
    with suppress(Gone):
        while True:
            await act()
