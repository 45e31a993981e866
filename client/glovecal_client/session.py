"""zenoh sessions with nothing left to chance: explicit endpoints, no scouting, always closed.

Everything at the edge (capture, subscribers, tools) is a client of one router, which the service runs, or of
one of several that are linked: peers do not relay for each other since zenoh 1.9. A question that gets no
answer is a failure. With a site's file (``GLOVECAL_SITE_FILE``) every connection is encrypted and both sides
show a certificate.
"""

from __future__ import annotations

import base64
import json
import re
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, cast

import zenoh

from glovecal_client.errors import BadName, NoAnswer, NotAdmitted, QueryRefused
from glovecal_client.hosts import is_unspecified
from glovecal_client.site.certificates import check_certificate
from glovecal_client.site.login import why_refused
from glovecal_client.site.member import Member, member_of_environment
from glovecal_client.site.renewed_session import RenewedSession, is_admitted
from glovecal_client.site.rules import Rules

DEFAULT_ENDPOINT = "tcp/127.0.0.1:7447"
MAX_PUT_BYTES = 65536
"""The router drops larger puts at its door; our largest message, a pose, has under 10 kB."""

_ATTEMPT_MS = 1000
_RETRY = {"period_init_ms": 100, "period_max_ms": 400, "period_increase_factor": 2}
"""After a router that restarts; zenoh's own, 1 s doubling to 4 s, may miss it by 4 s."""
_BATCHES_WAITING, _QUEUES = 16, ("interactive_high", "data")
"""zenoh's most. An express message takes a batch of its own, and with zenoh's two a computer that is busy
for 25 ms loses frames; 16 carry over 130 ms at 120 Hz. Old frames are left out by the service, not here."""


def client_config(
    endpoints: Sequence[str] = (DEFAULT_ENDPOINT,), member: Member | None = None
) -> zenoh.Config:
    """A client of the router at ``endpoints``; nothing is bound, no scouting, no shared memory.

    Of several the first that answers; when it goes, another. Of a site's ``member``: encrypted, and only to a
    router that its authority signed.
    """
    settings: dict[str, Any] = {"endpoints": _each(endpoints), "timeout_ms": _ATTEMPT_MS, "retry": _RETRY}
    if member is not None:
        settings["endpoints"] = reached_endpoints(endpoints, member)
    connect = {f"connect/{name}": value for name, value in settings.items()}
    return _config("client", connect | _certificates(member, "connect"))


def router_config(
    endpoints: Sequence[str] = (DEFAULT_ENDPOINT,),
    *,
    peers: Sequence[str] = (),
    max_put_bytes: int = MAX_PUT_BYTES,
    member: Member | None = None,
    rules: Rules | None = None,
) -> zenoh.Config:
    """A router that listens on ``endpoints`` and refuses puts over ``max_put_bytes``.

    It links itself to the routers at ``peers``, whenever they are there, so that both are one for all others.
    With a site's ``member`` and ``rules`` it asks everybody for a certificate and lets each do what the rules
    say.
    """
    limit = {
        "id": "oversized-puts",
        "flows": ["ingress"],
        "messages": ["put"],
        "key_exprs": ["**"],
        "size_limit": max_put_bytes,
    }
    listen, linked = list(endpoints), list(peers)
    if member is not None:
        listen, linked = [*map(encrypted, endpoints)], [*map(encrypted, peers)]
    settings: dict[str, Any] = {"listen/endpoints": listen, "connect/endpoints": linked}
    if linked:
        settings |= {"connect/timeout_ms": 0, "connect/exit_on_failure": False, "connect/retry": _RETRY}
    if rules is not None:
        settings["access_control"] = rules.access_control()
    return _config(
        "router", settings | {"low_pass_filter": [limit]} | _certificates(member, "listen", "connect")
    )


def _each(endpoints: Sequence[str]) -> list[str]:
    """One text may name several, separated by commas."""
    return [each.strip() for text in endpoints for each in text.split(",")]


def _certificates(member: Member | None, *sides: str) -> dict[str, Any]:
    """As text in zenoh's configuration: no private key lies in a file of its own."""
    if member is None:
        return {}
    own = {"private_key": member.private_key, "certificate": member.certificate}
    texts = {f"{side}_{name}": pem for side in sides for name, pem in own.items()}
    texts["root_ca_certificate"] = member.authority
    settings: dict[str, Any] = {
        f"{name}_base64": base64.b64encode(pem.encode()).decode() for name, pem in texts.items()
    }
    return {"transport/link/tls": settings | {"enable_mtls": True, "close_link_on_expiration": True}}


_ENDPOINT = re.compile(r"(tcp|tls)/(\[[^\]]+\]|[^:/]+)(:.+)\Z")


def encrypted(endpoint: str) -> str:
    """``tcp/HOST:PORT`` as ``tls/HOST:PORT``. Raises BadName for what cannot be encrypted."""
    parts = _ENDPOINT.match(endpoint)
    if parts is None:
        raise BadName(
            f"endpoint {endpoint!r} cannot be used at a site with certificates: write tls/HOST:PORT"
        )
    return f"tls/{parts[2]}{parts[3]}"


def reached_endpoints(endpoints: Sequence[str], member: Member) -> list[str]:
    """Where ``member`` connects: as its file says, unless told otherwise; encrypted. Raises BadName."""
    if tuple(endpoints) == (DEFAULT_ENDPOINT,) and member.kind != "service":
        return list(member.zenoh)
    reached = []
    for endpoint in map(encrypted, _each(endpoints)):
        parts = _ENDPOINT.match(endpoint)
        assert parts is not None
        reached.append(f"tls/{_here(parts[2])}{parts[3]}")
    return reached


def _here(host: str) -> str:
    """Who listens everywhere is reached on loopback; a certificate names no 0.0.0.0."""
    return ("[::1]" if ":" in host else "127.0.0.1") if is_unspecified(host) else host


def _config(mode: str, settings: dict[str, Any]) -> zenoh.Config:
    config = zenoh.Config()
    common = {
        "mode": mode,
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": False,
        "scouting/delay": 0,  # a router would be ready half a second later, for nothing
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
    foreign: bool = False,
) -> Iterator[zenoh.Session]:
    """A client session that is closed at the end of the ``with`` block.

    Waits for the router: for ever with ``wait_s=None``, else that many seconds, then raises NoAnswer.
    ``cancelled`` is asked between attempts, about once a second; when true, raises NoAnswer too.

    With ``GLOVECAL_SITE_FILE`` it is a member of a site; raises BadSiteFile for that file, and NotAdmitted,
    at once, where the site does not let it in. A file that was renewed is used without losing the connection.
    ``foreign``: the router is another system's, not of the site.
    """
    member = None if foreign else member_of_environment()
    if member is not None:
        check_certificate(member)
    session = _connect(endpoints, wait_s, cancelled, member)
    if member is None:
        try:
            yield session
        finally:
            session.close()
        return
    kept = RenewedSession(member, session, lambda now: zenoh.open(client_config(endpoints, now)))
    try:
        yield cast(zenoh.Session, kept.session)
    finally:
        kept.close()


def _connect(
    endpoints: Sequence[str],
    wait_s: float | None,
    cancelled: Callable[[], bool] | None,
    member: Member | None,
) -> zenoh.Session:
    try:
        client_config(endpoints, member)
    except zenoh.ZError as error:
        raise BadName(f"endpoint {', '.join(endpoints)!r} is not like {DEFAULT_ENDPOINT!r}") from error
    started = time.monotonic()
    while True:
        try:
            session = zenoh.open(client_config(endpoints, member))
            if member is not None:
                _require_admission(session, member, endpoints)
            return session
        except zenoh.ZError as error:
            if member is not None:
                _require_no_refusal(member, reached_endpoints(endpoints, member))
            late = wait_s is not None and time.monotonic() - started >= wait_s
            if late or (cancelled is not None and cancelled()):
                where = ", ".join(endpoints if member is None else reached_endpoints(endpoints, member))
                raise NoAnswer(f"no router at {where}; is the service running?") from error
            time.sleep(0.05)


ADMITTED_WITHIN_S = 3.0


def _require_admission(session: zenoh.Session, member: Member, endpoints: Sequence[str]) -> None:
    """A router with rules takes everybody of its authority and then tells nothing to whom it does not know.

    Raises NotAdmitted, with the session closed.
    """
    until = time.monotonic() + ADMITTED_WITHIN_S
    while time.monotonic() < until:
        if is_admitted(session, member.site):
            return
        time.sleep(0.05)
    session.close()
    raise NotAdmitted(
        f"the service at {', '.join(reached_endpoints(endpoints, member))} does not let {member.name!r} do "
        f"anything at site {member.site!r}: it was revoked, or is a member of another name there; look with "
        "`glovecal site list` at the service"
    )


def _require_no_refusal(member: Member, endpoints: Sequence[str]) -> None:
    for endpoint in endpoints:
        why = why_refused(member, endpoint)
        if why is not None:
            raise NotAdmitted(why)


@contextmanager
def open_router(
    endpoints: Sequence[str] = (DEFAULT_ENDPOINT,),
    *,
    peers: Sequence[str] = (),
    max_put_bytes: int = MAX_PUT_BYTES,
) -> Iterator[zenoh.Session]:
    """A router session (itself a full participant) that is closed at the end of the ``with`` block."""
    session = zenoh.open(router_config(endpoints, peers=peers, max_put_bytes=max_put_bytes))
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
