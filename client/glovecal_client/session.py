"""zenoh sessions with nothing left to chance: explicit endpoints, no scouting, always closed.

Everything at the edge (capture, subscribers, tools) is a client of one router, which the service runs: peers
do not relay for each other since zenoh 1.9. A question that gets no answer is a failure.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import zenoh

from glovecal_client.errors import BadName, NoAnswer, QueryRefused

DEFAULT_ENDPOINT = "tcp/127.0.0.1:7447"
MAX_PUT_BYTES = 65536
"""The router drops larger puts at its door; our largest message, a pose, has under 10 kB."""

_ATTEMPT_MS = 1000
_RETRY = {"period_init_ms": 100, "period_max_ms": 400, "period_increase_factor": 2}
"""After a router that restarts; zenoh's own, 1 s doubling to 4 s, may miss it by 4 s."""
_BATCHES_WAITING, _QUEUES = 16, ("interactive_high", "data")
"""zenoh's most. An express message takes a batch of its own, and with zenoh's two a computer that is busy
for 25 ms loses frames; 16 carry over 130 ms at 120 Hz. Old frames are left out by the service, not here."""


def client_config(endpoints: Sequence[str] = (DEFAULT_ENDPOINT,)) -> zenoh.Config:
    """A client of the router at ``endpoints``; nothing is bound, no scouting, no shared memory."""
    settings = {"endpoints": list(endpoints), "timeout_ms": _ATTEMPT_MS, "retry": _RETRY}
    return _config("client", {f"connect/{name}": value for name, value in settings.items()})


def router_config(
    endpoints: Sequence[str] = (DEFAULT_ENDPOINT,), *, max_put_bytes: int = MAX_PUT_BYTES
) -> zenoh.Config:
    """A router that listens on ``endpoints`` and refuses puts over ``max_put_bytes``."""
    limit = {
        "id": "oversized-puts",
        "flows": ["ingress"],
        "messages": ["put"],
        "key_exprs": ["**"],
        "size_limit": max_put_bytes,
    }
    return _config(
        "router", {"listen/endpoints": list(endpoints), "connect/endpoints": [], "low_pass_filter": [limit]}
    )


def _config(mode: str, settings: dict[str, Any]) -> zenoh.Config:
    config = zenoh.Config()
    common = {
        "mode": mode,
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": False,
        "transport/shared_memory/enabled": False,
        **{f"transport/link/tx/queue/size/{name}": _BATCHES_WAITING for name in _QUEUES},
    }
    for path, value in (common | settings).items():
        config.insert_json5(path, json.dumps(value))
    return config


@contextmanager
def open_client(
    endpoints: Sequence[str] = (DEFAULT_ENDPOINT,),
    *,
    wait_s: float | None = None,
    cancelled: Callable[[], bool] | None = None,
) -> Iterator[zenoh.Session]:
    """A client session that is closed at the end of the ``with`` block.

    Waits for the router: for ever with ``wait_s=None``, else that many seconds, then raises NoAnswer.
    ``cancelled`` is asked between attempts, about once a second; when true, raises NoAnswer too.
    """
    session = _connect(endpoints, wait_s, cancelled)
    try:
        yield session
    finally:
        session.close()


def _connect(
    endpoints: Sequence[str], wait_s: float | None, cancelled: Callable[[], bool] | None
) -> zenoh.Session:
    try:
        client_config(endpoints)
    except zenoh.ZError as error:
        raise BadName(f"endpoint {', '.join(endpoints)!r} is not like {DEFAULT_ENDPOINT!r}") from error
    started = time.monotonic()
    while True:
        try:
            return zenoh.open(client_config(endpoints))
        except zenoh.ZError as error:
            late = wait_s is not None and time.monotonic() - started >= wait_s
            if late or (cancelled is not None and cancelled()):
                raise NoAnswer(f"no router at {', '.join(endpoints)}; is the service running?") from error
            time.sleep(0.05)


@contextmanager
def open_router(
    endpoints: Sequence[str] = (DEFAULT_ENDPOINT,), *, max_put_bytes: int = MAX_PUT_BYTES
) -> Iterator[zenoh.Session]:
    """A router session (itself a full participant) that is closed at the end of the ``with`` block."""
    session = zenoh.open(router_config(endpoints, max_put_bytes=max_put_bytes))
    try:
        yield session
    finally:
        session.close()


REFUSAL_ENCODING = "text/plain"
"""Of an answerer's own sentence; zenoh's errors, such as a timeout, come with another one."""


def ask(session: zenoh.Session, selector: str, *, timeout_s: float = 5.0) -> list[zenoh.Sample]:
    """All good replies. Raises QueryRefused with the answerer's own sentence, NoAnswer if nobody answered."""
    samples: list[zenoh.Sample] = []
    problem, refused = "nobody answered", False
    replies = session.get(
        selector,
        timeout=timeout_s,
        target=zenoh.QueryTarget.ALL,
        consolidation=zenoh.ConsolidationMode.NONE,
    )
    for reply in replies:
        if reply.ok is not None:
            samples.append(reply.ok)
        elif reply.err is not None:
            problem = reply.err.payload.to_bytes().decode(errors="replace")[:500]
            refused = str(reply.err.encoding) == REFUSAL_ENCODING
    if not samples:
        raise (QueryRefused if refused else NoAnswer)(f"{selector}: {problem}")
    return samples


def ask_json(session: zenoh.Session, selector: str, *, timeout_s: float = 5.0) -> dict[str, Any]:
    """The first reply that is a JSON object. Raises NoAnswer."""
    for sample in ask(session, selector, timeout_s=timeout_s):
        document = json_object(sample.payload.to_bytes())
        if document is not None:
            return document
    raise NoAnswer(f"{selector}: the answer is not a JSON object")


def json_object(payload: bytes) -> dict[str, Any] | None:
    """The JSON object in ``payload``, None if it is anything else."""
    try:
        document = json.loads(payload)
    except (ValueError, RecursionError):
        return None
    return document if isinstance(document, dict) else None
