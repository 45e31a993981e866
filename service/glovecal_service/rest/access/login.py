"""The login of the studio: a key is typed once, a cookie keeps the session; a page of plain HTML."""

from __future__ import annotations

from html import escape
from urllib.parse import parse_qs

from fastapi import APIRouter, Request, Response
from fastapi.responses import HTMLResponse, RedirectResponse
from starlette.concurrency import run_in_threadpool

from glovecal_service.rest.http.access import LOGIN, session_token
from glovecal_service.rest.http.dependencies import StoreNeeded
from glovecal_service.rest.http.observation import SESSION_COOKIE, STUDIO
from glovecal_service.store.keys import SESSION_HOURS

router = APIRouter(prefix=LOGIN, include_in_schema=False)
LONGEST = 4096
_POLICY = "default-src 'none'; style-src 'unsafe-inline'; form-action 'self'; frame-ancestors 'none'"
_PAGE = """<!doctype html>
<html lang="en">
<meta charset="utf-8">
<meta name="viewport" content="width=device-width">
<title>Glovecal: log in</title>
<style>
:root { color-scheme: light dark; font: 1rem/1.5 system-ui, sans-serif; }
body { max-width: 26rem; margin: 15vh auto; padding: 0 1.5rem; }
input, button { font: inherit; padding: .6rem; width: 100%; box-sizing: border-box; margin-top: .4rem; }
button { margin-top: 1rem; min-height: 2.75rem; }
</style>
<h1>Glovecal</h1>
<p role="alert">SAID</p>
<form method="post" action="/login">
<label>Your key<input name="key" type="password" autocomplete="current-password" required autofocus></label>
<input name="page" type="hidden" value="PAGE">
<button>Log in</button>
</form>
<p>An admin of this site makes keys: <code>glovecal key add NAME --role viewer</code>.</p>
</html>
"""


@router.get("")
def show_login(page: str = "") -> HTMLResponse:
    return _page("This service asks who you are.", page, 200)


@router.post("")
async def log_in(request: Request, store: StoreNeeded) -> Response:
    form = parse_qs((await request.body())[:LONGEST].decode("utf-8", "replace"))
    page = form.get("page", [""])[0]
    token = await run_in_threadpool(store.keys.begin_session, form.get("key", [""])[0].strip())
    if token is None:
        return _page("That is no key of this service, or it was revoked.", page, 401)
    answer = RedirectResponse(_own(page), status_code=303)
    answer.set_cookie(
        SESSION_COOKIE, token, max_age=SESSION_HOURS * 3600, httponly=True, samesite="strict",
        secure=request.url.scheme == "https",
    )  # fmt: skip
    return answer


@router.delete("")
async def log_out(request: Request, store: StoreNeeded) -> Response:
    token = session_token(request.headers.get("cookie", ""))
    if token is not None:
        await run_in_threadpool(store.keys.end_session, token)
    answer = Response(status_code=204)
    answer.delete_cookie(SESSION_COOKIE)
    return answer


def _own(page: str) -> str:
    """A page of the studio, never another site's address."""
    return page if page.startswith(f"/{STUDIO}") and "//" not in page and "\\" not in page else f"/{STUDIO}"


def _page(sentence: str, page: str, status: int) -> HTMLResponse:
    text = _PAGE.replace("SAID", escape(sentence)).replace("PAGE", escape(_own(page), quote=True))
    headers = {"Content-Security-Policy": _POLICY, "Cache-Control": "no-store"}
    return HTMLResponse(text, status_code=status, headers=headers)
