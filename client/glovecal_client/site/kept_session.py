"""A zenoh session that goes on when its connection is made anew, for a renewed certificate or other rules.

zenoh reads certificates and rules when a session opens, and never again. So the session is replaced by a new
one and everything that was declared is declared there again; who declared it notices nothing.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from types import TracebackType
from typing import Any

import zenoh

REOPEN_WITHIN_S = 10.0
_ATTEMPT_EVERY_S = 0.02


class KeptSession:
    """Used as a ``zenoh.Session``. While it is being replaced, what is put is lost."""

    def __init__(
        self,
        open_session: Callable[[], zenoh.Session],
        wait_for_router: Callable[[zenoh.Session], object] | None,
    ) -> None:
        """``wait_for_router`` returns when the router has answered a new session, and so knows what was
        declared on it: until then the old one hears. None: a router itself, whose old session must be closed
        before a new one can open, as it has the port."""
        self._open_session = open_session
        self._wait_for_router = wait_for_router
        self._lock = threading.RLock()
        self._session = open_session()
        self._closed = False
        self._declared: list[Declared] = []

    def reopen(self) -> None:
        """Replace the session. Raises zenoh.ZError when no new one can be opened; then the old one goes on,
        or is gone if it is a router's."""
        with self._lock:
            if self._closed:
                return
            old = self._session
            if self._wait_for_router is None:
                old.close()
            self._session = self._opened()
            for each in self._declared:
                each.declare_on(self._session)
        if self._wait_for_router is not None:
            try:
                self._wait_for_router(self._session)
            finally:
                old.close()

    def _opened(self) -> zenoh.Session:
        until = time.monotonic() + REOPEN_WITHIN_S
        while True:
            try:
                return self._open_session()
            except zenoh.ZError:
                if time.monotonic() >= until:
                    raise
                time.sleep(_ATTEMPT_EVERY_S)

    def close(self) -> None:
        """For good."""
        with self._lock:
            self._closed = True
            self._session.close()

    def declare_subscriber(self, *arguments: Any, **options: Any) -> Declared:
        return self._declare(Declared, lambda session: session.declare_subscriber(*arguments, **options))

    def declare_publisher(self, *arguments: Any, **options: Any) -> Declared:
        return self._declare(Declared, lambda session: session.declare_publisher(*arguments, **options))

    def declare_queryable(self, *arguments: Any, **options: Any) -> Declared:
        return self._declare(Declared, lambda session: session.declare_queryable(*arguments, **options))

    def liveliness(self) -> KeptLiveliness:
        return KeptLiveliness(self)

    def put(self, *arguments: Any, **options: Any) -> None:
        session = self._session
        try:
            session.put(*arguments, **options)
        except zenoh.ZError:
            if self._is_current(session):
                raise

    def get(self, *arguments: Any, **options: Any) -> Any:
        with self._lock:
            return self._session.get(*arguments, **options)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._session, name)

    def _declare(self, kind: type[Declared], make: Callable[[zenoh.Session], Any]) -> Declared:
        with self._lock:
            declared = kind(self, make)
            declared.declare_on(self._session)
            self._declared.append(declared)
            return declared

    def _is_current(self, session: zenoh.Session) -> bool:
        """Once the session is not being replaced."""
        with self._lock:
            return self._closed or session is self._session

    def _forget(self, declared: Declared) -> None:
        with self._lock:
            if declared in self._declared:
                self._declared.remove(declared)


class KeptLiveliness:
    """Liveliness of a kept session."""

    def __init__(self, owner: KeptSession) -> None:
        self._owner = owner

    def declare_token(self, *arguments: Any, **options: Any) -> Declared:
        return self._owner._declare(
            Declared, lambda session: session.liveliness().declare_token(*arguments, **options)
        )

    def declare_subscriber(self, *arguments: Any, **options: Any) -> Declared:
        return self._owner._declare(
            Declared, lambda session: session.liveliness().declare_subscriber(*arguments, **options)
        )

    def get(self, *arguments: Any, **options: Any) -> Any:
        with self._owner._lock:
            return self._owner._session.liveliness().get(*arguments, **options)


class Declared:
    """A publisher, subscriber, queryable or token that is there on each session in turn."""

    def __init__(self, owner: KeptSession, make: Callable[[zenoh.Session], Any]) -> None:
        self._owner = owner
        self._make = make
        self._session: zenoh.Session | None = None
        self._now: Any = None
        self._over = False

    def declare_on(self, session: zenoh.Session) -> None:
        self._now, self._session = self._make(session), session

    def put(self, *arguments: Any, **options: Any) -> None:
        """Of a publisher."""
        now = self._now
        try:
            now.put(*arguments, **options)
        except zenoh.ZError:
            if self._is_over(now):
                raise

    def recv(self) -> Any:
        """Of a subscriber with a channel: the next sample, of the session there is then."""
        while True:
            now = self._now
            try:
                return now.recv()
            except zenoh.ZError:
                if self._is_over(now):
                    raise

    def try_recv(self) -> Any:
        """Of a subscriber with a channel: a sample, or None."""
        now = self._now
        try:
            return now.try_recv()
        except zenoh.ZError:
            if self._is_over(now):
                raise
            return None

    def __iter__(self) -> Iterator[Any]:
        while True:
            try:
                sample = self.recv()
            except zenoh.ZError:
                return
            yield sample

    def undeclare(self) -> None:
        """For good."""
        self._owner._forget(self)
        self._over = True
        self._now.undeclare()

    def _is_over(self, now: Any) -> bool:
        """Whether nothing takes the place of ``now``; known once the session is not being replaced."""
        with self._owner._lock:
            return self._over or self._owner._closed or now is self._now

    def __getattr__(self, name: str) -> Any:
        return getattr(self._now, name)

    def __enter__(self) -> Declared:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.undeclare()
