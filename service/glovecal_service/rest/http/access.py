"""Who may do what over REST and on pages: a key or a session says who asks, a table what its role may do.

On loopback nobody is asked: whoever works on this computer may read the data folder anyway. Beyond it, and
where ``GLOVECAL_LOGIN=always`` says so, a request without a valid key is answered 401, a page goes to the
login, and what a role may not do is 403. What is of other subjects is not there: the store itself narrows
every statement to those of the key (``store/scope.py``).
"""

from __future__ import annotations

import re
from dataclasses import replace
from http.cookies import CookieError, SimpleCookie
from urllib.parse import quote

from starlette.concurrency import run_in_threadpool
from starlette.responses import RedirectResponse
from starlette.types import ASGIApp, Receive, Scope, Send

from glovecal_client.site.roles import Role, includes
from glovecal_service.plain import plain_text
from glovecal_service.rest.http.fair_share import FairShare
from glovecal_service.rest.http.observation import PREFIX, SESSION_COOKIE, STUDIO
from glovecal_service.rest.http.problem import Problem
from glovecal_service.rest.http.request_guard import SAFE_METHODS
from glovecal_service.store.actor import Actor
from glovecal_service.store.errors import NotFound
from glovecal_service.store.gloves import Gloves
from glovecal_service.store.principals import Principal
from glovecal_service.store.store import Store

FEED = re.compile(rf"/{STUDIO}/feed/([^/]+)")
"""Of a page that draws a glove's hand: poses, which no statement of the store narrows."""
LOGIN = "/login"
BY_PROVIDER = f"{LOGIN}/oidc"
LONGEST_ACTION = 200
OPEN = re.compile(rf"{PREFIX}/health/(live|ready)|{LOGIN}(/password)?|{BY_PROVIDER}(/callback)?")
"""What answers to everybody: it tells nothing of what is stored."""
_ASKED_BY_POST = (
    r"models/[^/]+/(compare|where|explain|predict|replay|series|residual|report|calibration-report"
    r"|effect-picture)|motion(/character)?|takes/(hands|holds|preview|session-drift)"
)
"""Questions whose body says what is asked; nothing changes."""
_OF_SESSIONS = (
    r"(recordings|sampling|films|cameras|camera-files|glove-commands|gloves|serial-ports|simulated-glove"
    r"|hidden-effects|subjects|takes|uploads|videos)(/.*)?"
)
RULES: tuple[tuple[str, str, Role], ...] = (
    (r".*", r"(keys|people|audit|erasures)(/.*)?", "admin"),
    (r"DELETE", r"subjects/.*", "admin"),
    (r"GET|HEAD", r"subjects/[^/]+/export|gloves/[^/]+/people", "trainer"),
    (r"GET|HEAD|OPTIONS", r".*", "viewer"),
    (r"POST", _ASKED_BY_POST, "viewer"),
    (r"DELETE", r"takes/[^/]+", "trainer"),
    (r".*", r"takes/([^/]+/left-out.*|clocks.*|examination.*)|subjects/[^/]+/detectability", "trainer"),
    (r".*", _OF_SESSIONS, "operator"),
    (r".*", r".*", "trainer"),
)
"""Method, path below ``/v1`` and the least role that may; the first that fits counts."""
NOT_OF_A_SUBJECT = re.compile(
    r"(films|cameras|camera-files|metrics|glove-commands|glove-devices|serial-ports|simulated-glove)(/.*)?"
)
"""What does not say whose it is: not there for a key of some subjects."""


def role_for(method: str, path: str) -> Role:
    """The least role for a request; ``path`` below ``/v1``, without its first slash."""
    for methods, paths, role in RULES:
        if re.fullmatch(methods, method) and re.fullmatch(paths, path):
            return role
    raise AssertionError("the last rule fits everything")


class AccessGuard:
    """ASGI middleware. ``application`` has the store in its state once it has started."""

    def __init__(self, app: ASGIApp, *, is_asked: bool) -> None:
        """``is_asked``: whether anybody has to prove who they are."""
        self.app = app
        self.is_asked = is_asked
        self._share = FairShare()

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] not in ("http", "websocket"):
            await self.app(scope, receive, send)
            return
        path, method = scope["path"], scope.get("method", "GET")
        asking = Actor(
            origin=(scope.get("client") or ("",))[0], action=plain_text(f"{method} {path}", LONGEST_ACTION)
        )
        state = scope.setdefault("state", {})
        state["actor"] = asking
        if not self.is_asked or OPEN.fullmatch(path):
            await self.app(scope, receive, send)
            return
        store: Store = scope["app"].state.parts.store
        record = await run_in_threadpool(_who, store, scope)
        problem = _problem(record, method, path)
        if record is not None and problem is None:
            subjects = None if record.subjects is None else frozenset(record.subjects)
            state["actor"] = replace(asking, name=record.name, subjects=subjects)
            feed = FEED.fullmatch(path)
            seen_by = store.acting_as(state["actor"]).gloves
            if feed is not None and not await run_in_threadpool(_is_seen, seen_by, feed[1]):
                problem = Problem(404, "not-found", "There is no such glove.")
            else:
                problem = await self._answered(record.name, scope, receive, send)
                if problem is None:
                    return
        if scope["type"] == "websocket":
            await send({"type": "websocket.close", "code": 1008})
        elif record is None and method in SAFE_METHODS and not path.startswith(f"{PREFIX}/"):
            page = RedirectResponse(f"{LOGIN}?page={quote(path)}", status_code=303)
            await page(scope, receive, send)
        elif problem is not None:
            await problem.response(state.get("request_id"))(scope, receive, send)

    async def _answered(self, who: str, scope: Scope, receive: Receive, send: Send) -> Problem | None:
        """Why it was not."""
        if scope["type"] == "websocket":  # stays open
            await self.app(scope, receive, send)
            return None
        try:
            async with self._share.turn(who, scope["path"]):
                await self.app(scope, receive, send)
        except Problem as problem:
            return problem
        return None


def _is_seen(gloves: Gloves, glove: str) -> bool:
    try:
        gloves.get(glove)
    except NotFound:
        return False
    return True


def _who(store: Store, scope: Scope) -> Principal | None:
    headers = {name: value.decode("latin-1") for name, value in scope["headers"]}
    kind, _, secret = headers.get(b"authorization", "").partition(" ")
    if kind.lower() == "bearer":
        return store.keys.of(secret.strip())
    token = session_token(headers.get(b"cookie", ""))
    return None if token is None else store.sessions.of(token)


def session_token(cookies: str) -> str | None:
    """That of a ``Cookie`` header."""
    try:
        cookie = SimpleCookie(cookies).get(SESSION_COOKIE)
    except CookieError:
        return None
    return None if cookie is None else cookie.value


def _problem(record: Principal | None, method: str, path: str) -> Problem | None:
    if record is None:
        return Problem(
            401,
            "login-needed",
            "This service asks who you are: send a key, as in `Authorization: Bearer glk_...` (for commands "
            "GLOVECAL_KEY) that is not revoked. An admin makes one: glovecal key add NAME --role viewer.",
            headers={"WWW-Authenticate": "Bearer"},
        )
    if not path.startswith(f"{PREFIX}/"):
        return None
    below = path.removeprefix(f"{PREFIX}/")
    if record.subjects is not None and NOT_OF_A_SUBJECT.fullmatch(below):
        return Problem(404, "not-found", "There is nothing under this path for who sees some subjects only.")
    needed = role_for(method, below)
    if not includes(record.role, needed):
        return Problem(403, "role-too-low", _too_low(record, needed))
    return None


def _too_low(record: Principal, needed: Role) -> str:
    if record.issuer is not None:
        return (
            f"{record.name} has the role {record.role}, by the login at {record.issuer}; this needs "
            f"{needed}. An admin changes that there, or in GLOVECAL_OIDC_ROLES."
        )
    if record.is_person:
        return (
            f"{record.name} has the role {record.role}; this needs {needed}. An admin changes that, as in: "
            f"glovecal person change {record.name} --role {needed}."
        )
    return (
        f"Key {record.name} is of a {record.role}; this needs {needed}. An admin makes such, as in: "
        "glovecal key add NAME --role operator."
    )
