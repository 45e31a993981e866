"""The login of the studio: a name and a password, or a key, is typed once, and a cookie keeps the session;
pages of plain HTML. Whoever has a password changes it here."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from html import escape
from urllib.parse import parse_qs, urlencode

from fastapi import APIRouter, Request, Response
from fastapi.responses import HTMLResponse, RedirectResponse
from starlette.concurrency import run_in_threadpool

from glovecal_models.errors import BadInput
from glovecal_service.rest.http.access import BY_PROVIDER, LOGIN, session_token
from glovecal_service.rest.http.dependencies import Parts, PartsNeeded, StoreNeeded
from glovecal_service.rest.http.observation import SESSION_COOKIE, STUDIO
from glovecal_service.rest.http.problem import Problem
from glovecal_service.store.passwords import LEAST_CHARACTERS
from glovecal_service.store.principals import Principal
from glovecal_service.store.sessions import SESSION_HOURS

router = APIRouter(prefix=LOGIN, include_in_schema=False)
LONGEST = 8192
LONGEST_NAME = 64
WRONG = "That name and password do not belong together."
_POLICY = "default-src 'none'; style-src 'unsafe-inline'; form-action 'self'; frame-ancestors 'none'"
_PAGE = """<!doctype html>
<html lang="en">
<meta charset="utf-8">
<meta name="viewport" content="width=device-width">
<title>Glovecal: TITLE</title>
<style>
:root { color-scheme: light dark; font: 1rem/1.5 system-ui, sans-serif; }
body { background: Canvas; color: CanvasText; max-width: 26rem; margin: 10vh auto; padding: 0 1.5rem; }
input, button { font: inherit; padding: .6rem; width: 100%; box-sizing: border-box; margin-top: .4rem; }
label { display: block; margin-top: .8rem; }
button { margin-top: 1rem; min-height: 2.75rem; }
a { color: LinkText; }
a.button { display: block; box-sizing: border-box; min-height: 2.75rem; padding: .6rem; text-align: center;
  border: 1px solid ButtonBorder; border-radius: .25rem; background: ButtonFace; color: ButtonText;
  text-decoration: none; }
form + form { border-top: 1px solid GrayText; margin-top: 2rem; padding-top: .8rem; }
</style>
<main>
<h1>Glovecal</h1>
<p role="alert">SENTENCE</p>
FORMS
</main>
</html>
"""
_NAME = """<label>Name
<input name="name" autocomplete="username" autocapitalize="none" required autofocus></label>
<label>Password<input name="password" type="password" autocomplete="current-password" required></label>"""
_LOGIN = f"""<form method="post" action="/login">
{_NAME}
<input name="page" type="hidden" value="PAGE">
<button>Log in</button>
<p><a href="/login/password">Change your password</a></p>
</form>
<form method="post" action="/login">
<label>Your key<input name="key" type="password" autocomplete="off" required></label>
<input name="page" type="hidden" value="PAGE">
<button>Log in with a key</button>
</form>
<p>An admin of this site adds people and makes keys: <code>glovecal person add NAME</code>,
<code>glovecal key add NAME</code>.</p>"""
_CHANGE = f"""<form method="post" action="/login/password">
{_NAME}
<label>New password, at least {LEAST_CHARACTERS} characters
<input name="new" type="password" autocomplete="new-password" minlength="{LEAST_CHARACTERS}" required></label>
<label>The new password again
<input name="again" type="password" autocomplete="new-password" required></label>
<button>Change the password</button>
</form>
<p><a href="/login">Back to the login</a></p>"""


@router.get("")
def show_login(parts: PartsNeeded, page: str = "") -> HTMLResponse:
    return login_page(parts, "This service asks who you are.", page, 200)


@router.post("")
async def log_in(request: Request, parts: PartsNeeded) -> Response:
    form = await _form(request)
    page = form.get("page", "")
    try:
        if "key" in form:
            wrong = "That is no key of this service, or it was revoked."
            principal = await run_in_threadpool(parts.store.keys.of, form["key"].strip())
        else:
            wrong = WRONG
            principal = await _person(request, parts, form)
    except Problem as problem:
        return login_page(parts, problem.detail, page, problem.status, problem.headers)
    token = None if principal is None else await run_in_threadpool(parts.store.sessions.begin, principal)
    if token is None:
        return login_page(parts, wrong, page, 401)
    answer = RedirectResponse(own_page(page), status_code=303)
    keep_session(answer, request, token)
    return answer


@router.delete("")
async def log_out(request: Request, store: StoreNeeded) -> Response:
    token = session_token(request.headers.get("cookie", ""))
    if token is not None:
        await run_in_threadpool(store.sessions.end, token)
    answer = Response(status_code=204)
    answer.delete_cookie(SESSION_COOKIE)
    return answer


@router.get("/password")
def show_change() -> HTMLResponse:
    return _change_page("Changing your password logs you out everywhere.", 200)


@router.post("/password")
async def change_password(request: Request, parts: PartsNeeded) -> Response:
    form = await _form(request)
    new = form.get("new", "")
    if new != form.get("again", ""):
        return _change_page("The new passwords differ; type the same twice.", 422)
    try:
        principal = await _person(request, parts, form)
        if principal is None:
            return _change_page(WRONG, 401)
        own = parts.store.acting_as(replace(request.state.actor, name=principal.name))
        await parts.guesses.in_turn(partial(own.people.set_password, principal.name, new))
    except Problem as problem:
        return _change_page(problem.detail, problem.status, problem.headers)
    except BadInput as error:
        return _change_page(f"Not changed: {error}.", 422)
    return login_page(parts, "The password is changed. Log in with the new one.", "", 200)


async def _form(request: Request) -> dict[str, str]:
    """The first value of each field."""
    fields = parse_qs((await request.body())[:LONGEST].decode("utf-8", "replace"), keep_blank_values=True)
    return {name: values[0] for name, values in fields.items()}


async def _person(request: Request, parts: Parts, form: dict[str, str]) -> Principal | None:
    """Who logs in with a name and a password. Raises Problem where that is too early."""
    name = form.get("name", "").strip().lower()[:LONGEST_NAME]
    ask = partial(parts.store.people.of, name, form.get("password", ""))
    return await parts.guesses.check(name, request.state.actor.origin, ask)


def keep_session(answer: Response, request: Request, token: str) -> None:
    """In the browser that asked."""
    answer.set_cookie(
        SESSION_COOKIE, token, max_age=SESSION_HOURS * 3600, httponly=True, samesite="strict",
        secure=request.url.scheme == "https",
    )  # fmt: skip


def own_page(page: str) -> str:
    """A page of the studio, else the front page; never another site's address."""
    return page if page.startswith(f"/{STUDIO}/") and "//" not in page and "\\" not in page else "/"


def login_page(
    parts: Parts, sentence: str, page: str, status: int, headers: dict[str, str] | None = None
) -> HTMLResponse:
    forms = _LOGIN.replace("PAGE", escape(own_page(page), quote=True))
    if parts.provider is not None:
        there = f"{BY_PROVIDER}?{urlencode({'page': own_page(page)})}"
        link = f'<a class="button" href="{escape(there)}">Log in with {escape(parts.provider.name)}</a>'
        forms = f"<p>{link}</p>\n{forms}"
    return plain_page("log in", sentence, forms, status, headers)


def _change_page(sentence: str, status: int, headers: dict[str, str] | None = None) -> HTMLResponse:
    return plain_page("change your password", sentence, _CHANGE, status, headers)


def plain_page(
    title: str, sentence: str, forms: str, status: int, headers: dict[str, str] | None
) -> HTMLResponse:
    """``forms`` is HTML, the rest is text."""
    text = _PAGE.replace("TITLE", title).replace("SENTENCE", escape(sentence)).replace("FORMS", forms)
    kept = {"Content-Security-Policy": _POLICY, "Cache-Control": "no-store", **(headers or {})}
    return HTMLResponse(text, status_code=status, headers=kept)
