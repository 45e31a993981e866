"""The login by a provider of OpenID Connect: a browser goes there, comes back with a code, and is let in."""

from __future__ import annotations

from dataclasses import replace
from html import escape
from urllib.parse import quote

from fastapi import APIRouter, Request, Response
from fastapi.responses import RedirectResponse
from starlette.concurrency import run_in_threadpool

from glovecal_models.errors import BadInput
from glovecal_service.rest.access.login import keep_session, login_page, own_page, plain_page
from glovecal_service.rest.http.access import BY_PROVIDER
from glovecal_service.rest.http.begun_logins import LOGIN_LASTS_S
from glovecal_service.rest.http.dependencies import Parts, PartsNeeded
from glovecal_service.rest.http.problem import Problem
from glovecal_service.rest.http.provider import Known, Provider
from glovecal_service.store.errors import Conflict
from glovecal_service.store.principals import Principal

router = APIRouter(prefix=BY_PROVIDER, include_in_schema=False)
COOKIE = "glovecal_login"
REFUSED = frozenset(
    {"invalid_request", "unauthorized_client", "unsupported_response_type", "invalid_scope", "server_error"}
)
"""Errors of RFC 6749 that are repeated to a person; others could say anything."""


@router.get("")
async def go_there(request: Request, parts: PartsNeeded, page: str = "") -> Response:
    try:
        provider = _provider(parts)
        callback = f"{request.url.scheme}://{request.url.netloc}{BY_PROVIDER}/callback"
        begun = provider.logins.begin(callback, own_page(page))
        answer = RedirectResponse(await provider.address_of(begun), status_code=303)
    except Problem as problem:
        return login_page(parts, problem.detail, page, problem.status)
    answer.headers["Cache-Control"] = "no-store"
    answer.set_cookie(
        COOKIE, provider.logins.sealed(begun), max_age=LOGIN_LASTS_S, path=BY_PROVIDER, httponly=True,
        samesite="lax", secure=request.url.scheme == "https",
    )  # fmt: skip
    return answer


@router.get("/callback")
async def come_back(
    request: Request, parts: PartsNeeded, code: str = "", state: str = "", error: str = ""
) -> Response:
    page = ""
    try:
        provider = _provider(parts)
        begun = provider.logins.end(request.cookies.get(COOKIE), state)
        page = begun.page
        if error or not code:
            raise _refused(provider, error)
        known = await provider.known(code, begun)
        principal = await run_in_threadpool(_let_in, request, parts, provider, known)
        token = await run_in_threadpool(parts.store.sessions.begin, principal)
        if token is None:
            raise Problem(409, "changed-meanwhile", "An admin changed what you may do. Begin again here.")
    except Problem as problem:
        answer = login_page(parts, problem.detail, page, problem.status)
    else:
        answer = _logged_in(page)
        keep_session(answer, request, token)
    answer.delete_cookie(COOKIE, path=BY_PROVIDER)
    return answer


def _logged_in(page: str) -> Response:
    """A page that goes on by itself: a redirect would be the provider's still, and what another site asks for
    comes without the session's cookie."""
    address = quote(page, safe="/:?&=%")
    link = f'<p><a href="{escape(address, quote=True)}">Go on</a></p>'
    return plain_page("logged in", "You are logged in.", link, 200, {"Refresh": f"0; url={address}"})


def _let_in(request: Request, parts: Parts, provider: Provider, known: Known) -> Principal:
    """Written down in the person's own name. Raises Problem."""
    if known.role is None:
        raise Problem(
            403,
            "no-role",
            f"{provider.name} knows you, and says nothing that gives you a role here. An admin puts your "
            "account there into a group that GLOVECAL_OIDC_ROLES names, or names one of yours in it.",
        )
    for is_last in (False, True):
        name = parts.store.people.name_of(provider.issuer, known.sub, known.preferred_name)
        people = parts.store.acting_as(replace(request.state.actor, name=name)).people
        try:
            return people.let_in(name, known.role, issuer=provider.issuer, sub=known.sub)
        except BadInput as error:
            raise Problem(403, "not-let-in", f"Not let in: {error}.") from error
        except Conflict:
            if is_last:
                break
    raise Problem(503, "busy", "Others log in for the first time at this moment. Begin again here.")


def _provider(parts: Parts) -> Provider:
    if parts.provider is None:
        raise Problem(
            404,
            "no-provider",
            "Nobody else says who you are: an admin names a provider in GLOVECAL_OIDC_ISSUER.",
        )
    return parts.provider


def _refused(provider: Provider, error: str) -> Problem:
    if error == "access_denied":
        return Problem(
            403, "denied", f"{provider.name} did not let you in, or you stopped there. Begin again."
        )
    named = f" ({error})" if error in REFUSED else ""
    return Problem(
        502,
        "provider-wrong",
        f"{provider.name} refused this login{named}; begin again. If it stays so, an admin compares the "
        "GLOVECAL_OIDC settings with what is registered there.",
    )
