"""Which process of a site has a glove: one at a time, found by each of them without asking anybody.

Each process has a liveliness token. Of those that are there, the glove belongs to the one whose name and the
glove's have the largest hash (rendezvous hashing, Thaler and Ravishankar 1998): when a process goes only its
gloves move, and when one comes it gets its share of all. It says that it has a glove by a token with a term,
higher than all it has seen of that glove; where two have one for a moment, the higher term has it.
"""

from __future__ import annotations

import hashlib
import time
from collections.abc import Iterable
from contextlib import suppress
from queue import SimpleQueue
from threading import RLock, Thread

import zenoh

from glovecal_client.errors import BadName
from glovecal_client.keys import (
    LAST_TERM,
    all_services,
    all_terms,
    parse_service_key,
    parse_term_key,
    service_alive_key,
    term_key,
)

SETTLED_WITHIN_S = 2.0
AGAIN_AFTER_S = 1.0
"""A glove that another took over is not taken back at once: both may be right by what they know."""
MOST_GLOVES = 4096


class GloveOwners:
    """The gloves of one process, ``instance``. For any thread; ``version`` changes with whatever changes."""

    def __init__(self, session: zenoh.Session, site: str, instance: str) -> None:
        """Knows all others when this returns, and is known to them once it is ``announce``d."""
        self.version = 0
        self._session, self._site, self._instance = session, site, instance
        self._lock = RLock()
        self._others: set[str] = set()
        self._terms: dict[str, dict[str, int]] = {}
        """Of the others, by glove and process."""
        self._highest: dict[str, int] = {}
        """Term ever seen of a glove."""
        self._mine: dict[str, int] = {}
        """Terms."""
        self._to_say: SimpleQueue[tuple[str, int, bool] | None] = SimpleQueue()
        """Glove, term, and whether it is had or no more: frames do not wait until that is said."""
        self._speaker = Thread(target=self._say, name="owners", daemon=True)
        self._lost_at: dict[str, float] = {}
        self._token: zenoh.LivelinessToken | None = None
        hear = zenoh.handlers.Callback
        tokens = session.liveliness()
        self._subscribers = [
            tokens.declare_subscriber(
                all_services(site), hear(self._hear_process, indirect=False), history=True
            ),
            tokens.declare_subscriber(all_terms(site), hear(self._hear_term, indirect=False), history=True),
        ]
        for key in (all_services(site), all_terms(site)):
            for reply in tokens.get(key, timeout=SETTLED_WITHIN_S):
                if reply.ok is not None:
                    (self._hear_process if key == all_services(site) else self._hear_term)(reply.ok)

    def announce(self) -> None:
        """From now on the others leave this process its share."""
        key = service_alive_key(self._site, self._instance)
        self._token = self._session.liveliness().declare_token(key)

    def close(self) -> None:
        """Leave all gloves to the others."""
        with self._lock:
            self._mine.clear()
        if self._token is not None:
            self._token.undeclare()
        self._to_say.put(None)
        if self._speaker.ident is not None:
            self._speaker.join()
        for each in self._subscribers:
            each.undeclare()

    def is_mine(self, glove: str) -> bool:
        """Whether this process speaks for the glove, with frames or without."""
        with self._lock:
            if glove in self._mine:
                return True
            return glove not in self._terms and self._is_next(glove)

    def may_take(self, glove: str) -> bool:
        """Whether it is this process' turn to have a glove whose frames come."""
        with self._lock:
            late_s = time.monotonic() - self._lost_at.get(glove, -AGAIN_AFTER_S)
            return glove in self._mine or (late_s >= AGAIN_AFTER_S and self._is_next(glove))

    def has(self, glove: str) -> bool:
        """Whether it was taken and is not lost."""
        with self._lock:
            return glove in self._mine

    def is_elsewhere(self, glove: str) -> bool:
        """Whether another process that is there has it."""
        with self._lock:
            return glove in self._terms

    def may_begin(self, glove: str, among: str = "") -> bool:
        """As ``may_take`` for work that stays where it began: not while another process has the glove.

        ``among``: only processes whose names begin so take turns.
        """
        with self._lock:
            return glove in self._mine or (glove not in self._terms and self._is_next(glove, among))

    def take(self, glove: str) -> tuple[int, bool]:
        """Take a glove over: its term, and whether another process had it before. Never waits."""
        with self._lock:
            had = self._mine.get(glove)
            if had is not None:
                return had, False
            before = self._highest.get(glove, 0)
            term = self._mine[glove] = min(max(before + 1, int(time.time())), LAST_TERM)
            self._note_highest(glove, term)
            if self._speaker.ident is None:
                self._speaker.start()
            self._to_say.put((glove, term, True))
            self._yield_if_overruled(glove)
        return term, before > 0

    def leave(self, glove: str) -> None:
        """Of no use here any more."""
        with self._lock:
            term = self._mine.pop(glove, None)
            if term is not None:
                self._to_say.put((glove, term, False))

    def kept(self, gloves: Iterable[str]) -> set[str]:
        """Those that this process still has."""
        with self._lock:
            return {glove for glove in gloves if glove in self._mine}

    def _say(self) -> None:
        """On a thread of its own: zenoh may take as long as a frame does."""
        tokens: dict[str, zenoh.LivelinessToken] = {}
        while (item := self._to_say.get()) is not None:
            glove, term, is_had = item
            token = tokens.pop(glove, None)
            with suppress(zenoh.ZError):  # of a session that was closed, whose tokens are gone with it
                if is_had:
                    key = term_key(self._site, self._instance, glove, term)
                    tokens[glove] = self._session.liveliness().declare_token(key)
                if token is not None:
                    token.undeclare()
        for token in tokens.values():
            with suppress(zenoh.ZError):
                token.undeclare()

    def _is_next(self, glove: str, among: str = "") -> bool:
        rivals = (other for other in self._others if other.startswith(among))
        return owner_of(glove, [self._instance, *rivals]) == self._instance

    def _note_highest(self, glove: str, term: int) -> None:
        if glove not in self._highest and len(self._highest) >= MOST_GLOVES:
            self._highest.clear()
        self._highest[glove] = max(term, self._highest.get(glove, 0))

    def _hear_process(self, sample: zenoh.Sample) -> None:
        try:
            process = parse_service_key(str(sample.key_expr))
        except BadName:
            return
        if process == self._instance or _kind(process) != _kind(self._instance):
            return
        with self._lock:
            self.version += 1
            if sample.kind == zenoh.SampleKind.PUT:
                self._others.add(process)
                return
            self._others.discard(process)
            for glove in [glove for glove, terms in self._terms.items() if process in terms]:
                self._forget_term(glove, process)

    def _hear_term(self, sample: zenoh.Sample) -> None:
        try:
            process, glove, term = parse_term_key(str(sample.key_expr))
        except BadName:
            return
        if process == self._instance or _kind(process) != _kind(self._instance):
            return
        with self._lock:
            self.version += 1
            if sample.kind != zenoh.SampleKind.PUT:
                if self._terms.get(glove, {}).get(process) == term:
                    self._forget_term(glove, process)
            elif glove in self._terms or len(self._terms) < MOST_GLOVES:
                self._terms.setdefault(glove, {})[process] = term
                self._note_highest(glove, term)
                self._yield_if_overruled(glove)

    def _forget_term(self, glove: str, process: str) -> None:
        del self._terms[glove][process]
        if not self._terms[glove]:
            del self._terms[glove]

    def _yield_if_overruled(self, glove: str) -> None:
        term = self._mine.get(glove)
        others = [(other, process) for process, other in self._terms.get(glove, {}).items()]
        if term is not None and others and max(others) > (term, self._instance):
            del self._mine[glove]
            self._to_say.put((glove, term, False))
            self._lost_at[glove] = time.monotonic()
            self.version += 1


def _kind(instance: str) -> str:
    """Of ``realtime-0c5f``: each kind of process has owners of its own."""
    return instance.partition("-")[0]


def owner_of(glove: str, instances: Iterable[str]) -> str:
    """Which process of those that are there has a glove (rendezvous hashing): all work out the same one, and
    one that goes leaves the gloves of the others where they are."""

    def weight(instance: str) -> bytes:
        return hashlib.blake2b(f"{instance}/{glove}".encode(), digest_size=8).digest()

    return max(instances, key=weight)
