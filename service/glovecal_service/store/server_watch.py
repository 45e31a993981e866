"""Nobody waits for a database server that stopped answering: its connections are given up, and who waits on
one is told.

A server that hangs, or a network that swallows packets, keeps a statement waiting for as long as TCP does.
Whether it hangs or only takes long over one statement is found by asking it something else.
"""

from __future__ import annotations

import os
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any

from sqlalchemy import Engine, event

from glovecal_service.store.errors import StoreUnavailable

LATE_AFTER_S = 2.0
ANSWERED_WITHIN_S = 2
"""By a server that is there; psycopg takes whole seconds, from 2 on."""
LOOK_EVERY_S, ENDS_AFTER_S = 0.25, 60.0
ASKED_AGAIN_AFTER_S = 2.0


class ServerWatch:
    """Of one engine with psycopg connections. Its thread ends when nobody has asked for a minute."""

    def __init__(self, engine: Engine) -> None:
        self._engine = engine
        self._lock = threading.Lock()
        self._waiting: dict[object, float] = {}
        """Transactions, and since when."""
        self._connections: set[Any] = set()
        self._hung_at = -ASKED_AGAIN_AFTER_S
        self._is_looking = False
        event.listen(engine, "do_connect", self._refuse)
        event.listen(engine, "connect", self._note)
        event.listen(engine, "close", self._forget)
        event.listen(engine, "close_detached", self._forget)

    @contextmanager
    def transaction(self) -> Iterator[None]:
        """Raises StoreUnavailable at once, for a moment after the server was found hanging."""
        self._refuse()
        mine = object()
        with self._lock:
            self._waiting[mine] = time.monotonic()
            if not self._is_looking:
                self._is_looking = True
                threading.Thread(target=self._look, name="database", daemon=True).start()
        try:
            yield
        finally:
            with self._lock:
                self._waiting.pop(mine, None)

    def _refuse(self, *_: object) -> None:
        """Nobody connects anew meanwhile either, as who was given up would."""
        if time.monotonic() - self._hung_at < ASKED_AGAIN_AFTER_S:
            raise StoreUnavailable(
                f"the database {self._engine.url.render_as_string(hide_password=True)} does not answer; is "
                "its server running?"
            )

    def _note(self, connection: Any, _record: object) -> None:
        self._connections.add(connection)

    def _forget(self, connection: Any, *_: object) -> None:
        self._connections.discard(connection)

    def _look(self) -> None:
        asked_at = time.monotonic()
        while True:
            time.sleep(LOOK_EVERY_S)
            with self._lock:
                now = time.monotonic()
                asked_at = now if self._waiting else asked_at
                if now - asked_at > ENDS_AFTER_S:
                    self._is_looking = False
                    return
                late = min(self._waiting.values(), default=now) < now - LATE_AFTER_S
            if late and not self._answers():
                self._hung_at = time.monotonic()
                for connection in list(self._connections):
                    _give_up(connection)
            elif late:
                time.sleep(ASKED_AGAIN_AFTER_S)

    def _answers(self) -> bool:
        arguments, options = self._engine.dialect.create_connect_args(self._engine.url)
        options["connect_timeout"] = ANSWERED_WITHIN_S
        try:
            with self._engine.dialect.loaded_dbapi.connect(*arguments, **options):
                return True
        except Exception:  # whatever a driver has for it
            return False


def _give_up(connection: Any) -> None:
    """Whoever waits for an answer on it has an error at once."""
    with suppress(Exception), socket.socket(fileno=os.dup(connection.fileno())) as line:  # if not closed
        line.shutdown(socket.SHUT_RDWR)
