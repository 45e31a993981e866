"""Nobody waits for a server that stopped answering: who waits for it is told.

A server that hangs, or a network that swallows packets, keeps a request waiting for as long as TCP does.
Whether it hangs or only takes long over one request is found by asking it something else.
"""

from __future__ import annotations

import os
import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Any

from sqlalchemy import Engine, event

from glovecal_service.store.errors import StoreUnavailable

LATE_AFTER_S = 1.5
ANSWERED_WITHIN_S = 2
"""By a server that is there; psycopg takes whole seconds, from 2 on."""
LOOK_EVERY_S, ENDS_AFTER_S = 0.25, 60.0
ASKED_AGAIN_AFTER_S = 2.0


class ServerWatch:
    """Of one server. Its thread ends when nobody has asked for a minute."""

    def __init__(
        self, what: str, answers: Callable[[], bool], give_up: Callable[[], None] = lambda: None
    ) -> None:
        """``answers``: whether the server answers a short question, within ``ANSWERED_WITHIN_S``; ``give_up``
        ends what waits for it."""
        self._what = what
        self._answers, self._give_up = answers, give_up
        self._lock = threading.Lock()
        self._waiting: dict[object, float] = {}
        """Who waits, and since when."""
        self._is_away = self._is_looking = False
        self._asked_at = 0.0

    @contextmanager
    def waiting(self) -> Iterator[None]:
        """Raises StoreUnavailable at once while the server is known not to answer."""
        mine = object()
        with self._lock:
            self._asked_at = time.monotonic()
            if not self._is_away:
                self._waiting[mine] = self._asked_at
            if not self._is_looking:
                self._is_looking = True
                threading.Thread(target=self._look, name=f"watch of {self._what}", daemon=True).start()
        self.require_answering()
        try:
            yield
        finally:
            with self._lock:
                self._waiting.pop(mine, None)

    def require_answering(self) -> None:
        """Raises StoreUnavailable."""
        if self._is_away:
            raise StoreUnavailable(f"{self._what} does not answer; is its server running?")

    def note_away(self) -> None:
        """Somebody found that it cannot be reached, while ``waiting``: the others are told at once."""
        self._is_away = True

    def _look(self) -> None:
        while True:
            time.sleep(LOOK_EVERY_S)
            with self._lock:
                now = time.monotonic()
                is_late = min(self._waiting.values(), default=now) < now - LATE_AFTER_S
                if not self._waiting and now - self._asked_at > ENDS_AFTER_S:
                    self._is_away = self._is_looking = False
                    return
            if self._is_away:
                self._is_away = not self._answers()
            elif is_late and not self._answers():
                self._is_away = True
                self._give_up()
            elif is_late:
                time.sleep(ASKED_AGAIN_AFTER_S)


def watched_connections(engine: Engine, what: str) -> ServerWatch:
    """Of an engine with psycopg connections, which are given up where the server hangs. Nobody connects anew
    meanwhile either, as who was given up would."""
    connections: set[Any] = set()

    def give_up() -> None:
        for connection in list(connections):
            _give_up(connection)

    watch = ServerWatch(what, lambda: _connects(engine), give_up)
    event.listen(engine, "do_connect", lambda *_: watch.require_answering())
    event.listen(engine, "connect", lambda connection, _: connections.add(connection))
    for end in ("close", "close_detached"):
        event.listen(engine, end, lambda connection, *_: connections.discard(connection))
    return watch


def _connects(engine: Engine) -> bool:
    arguments, options = engine.dialect.create_connect_args(engine.url)
    options["connect_timeout"] = ANSWERED_WITHIN_S
    try:
        with engine.dialect.loaded_dbapi.connect(*arguments, **options):
            return True
    except Exception:  # whatever a driver has for it
        return False


def _give_up(connection: Any) -> None:
    """Whoever waits for an answer on it has an error at once."""
    with suppress(Exception), socket.socket(fileno=os.dup(connection.fileno())) as line:  # if not closed
        line.shutdown(socket.SHUT_RDWR)
