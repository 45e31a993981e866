"""Who may do what: every route and role, own and other subjects, a revoked key, the login of the studio."""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import httpx
import pytest
from anyio.from_thread import start_blocking_portal
from fastapi import FastAPI
from starlette.types import Receive, Scope, Send

sys.path.insert(0, str(Path(__file__).parents[1]))

from realtime_support import store_model
from stored_takes import LAYOUT, make_take

from glovecal_client.site.roles import ROLES, Role
from glovecal_service.rest.app import create_app
from glovecal_service.rest.http.access import AccessGuard
from glovecal_service.rest.http.observation import SESSION_COOKIE
from glovecal_service.rest.in_process import PortalTransport
from glovecal_service.settings import Settings
from glovecal_service.store.store import Store

VIEWERS_POST = {
    *(f"/models/{{id}}/{each}" for each in ("compare", "where", "explain", "predict", "replay", "series")),
    *(f"/models/{{id}}/{each}" for each in ("residual", "report", "calibration-report", "effect-picture")),
    *("/motion", "/motion/character", "/takes/hands", "/takes/holds", "/takes/preview"),
    "/takes/session-drift",
}
TRAINERS = {
    *("DELETE /takes/{id}", "POST /takes/{id}/left-out", "POST /takes/{id}/left-out/undo"),
    *("POST /takes/clocks", "POST /takes/clocks/undo"),
    *("POST /takes/examination", "POST /takes/examination/report"),
    *("POST /improve", "POST /jobs/{id}/cancel", "POST /subjects/{name}/detectability"),
    "GET /subjects/{name}/export",
    "GET /gloves/{layout}/people",
}
ADMINS = {"DELETE /subjects/{name}", "GET /keys", "POST /keys", "DELETE /keys/{name}", "GET /audit",
          "GET /audit/check", "POST /erasures", "GET /people", "POST /people", "PUT /people/{name}",
          "PUT /people/{name}/password", "DELETE /people/{name}"}  # fmt: skip


def expected(method: str, path: str) -> Role:
    """What this page of the specification says, route by route."""
    if f"{method} {path}" in ADMINS:
        return "admin"
    if f"{method} {path}" in TRAINERS:
        return "trainer"
    if method == "GET" or (method == "POST" and path in VIEWERS_POST):
        return "viewer"
    if path.startswith("/models"):
        return "trainer"
    return "operator"


@dataclass
class Site:
    """A service that asks who one is, with takes and a model of anna and of ben."""

    store: Store
    http: httpx.Client
    guard: httpx.Client
    """The guard with nothing behind it: what it lets through is answered 204."""
    keys: dict[str, str]
    proofs: dict[str, dict[str, str]]
    """Headers by which it is known who asks: a key, or the session of a person."""
    ids: dict[str, dict[str, str]]
    """By subject: ids of what is theirs."""

    def ask(self, who: str | None, method: str, path: str, **more: Any) -> httpx.Response:
        headers = {} if who is None else self.proofs[who]
        return self.http.request(method, path, headers=headers, **more)

    def ask_guard(self, who: str, method: str, path: str) -> httpx.Response:
        return self.guard.request(method, path, headers=self.proofs[who])


def guard_of(app: FastAPI) -> Any:
    async def nothing(scope: Scope, receive: Receive, send: Send) -> None:
        await send({"type": "http.response.start", "status": 204, "headers": []})
        await send({"type": "http.response.body", "body": b""})

    guard = AccessGuard(nothing, is_asked=True)

    async def guarded(scope: Scope, receive: Receive, send: Send) -> None:
        await guard({**scope, "app": app}, receive, send)

    return guarded


@contextmanager
def site(data: Path, *, of_people: bool = False, **settings: Any) -> Iterator[Site]:
    """Asked with keys, or by people who logged in."""
    chosen = Settings(data=data, login="always", **settings)
    store = Store.open(chosen)
    store.layouts.put(LAYOUT)
    ids: dict[str, dict[str, str]] = {}
    for number, name in enumerate(("anna", "ben")):
        model = store_model(store, name, degrees_per_count=0.5)
        take = store.takes.add(make_take(number), subject=name, layout=LAYOUT.name, source="import")
        job = store.jobs.create("train", {"subject": name}, subject=name)
        ids[name] = {"name": name, "model": model, "take": take.id, "job": job.id}
    keys = {role: store.keys.create(role, role)[1] for role in ROLES}
    keys |= {f"anna's {role}": store.keys.create(f"anna-{role}", role, ["anna"])[1] for role in ROLES[:-1]}
    proofs = {who: bearer(key) for who, key in keys.items()}
    if of_people:
        proofs = {role: logged_in(store, role, None) for role in ROLES}
        proofs |= {f"anna's {role}": logged_in(store, role, ["anna"]) for role in ROLES[:-1]}
    app = create_app(chosen, store)
    with (
        start_blocking_portal() as portal,
        portal.wrap_async_context_manager(app.router.lifespan_context(app)),
        httpx.Client(transport=PortalTransport(app, portal), base_url="http://localhost/v1") as http,
        httpx.Client(
            transport=PortalTransport(guard_of(app), portal), base_url="http://localhost/v1"
        ) as guard,
    ):
        yield Site(store, http, guard, keys, proofs, ids)
    store.close()


@pytest.fixture(scope="module", params=["keys", "people"])
def asked(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    data = tmp_path_factory.mktemp("asked") / "data"
    with site(data, of_people=request.param == "people") as found:
        yield found


def bearer(key: str) -> dict[str, str]:
    return {"Authorization": f"Bearer {key}"}


def logged_in(store: Store, role: Role, subjects: list[str] | None) -> dict[str, str]:
    name = f"who-{role}-{'all' if subjects is None else '-'.join(subjects)}"
    token = store.sessions.begin(store.people.create(name, role, subjects, password="long enough by far"))
    return {"Cookie": f"{SESSION_COOKIE}={token}"}


def routes(of: Site) -> list[tuple[str, str]]:
    document = of.ask("admin", "GET", "/openapi.json").json()
    return [
        (method.upper(), path.removeprefix("/v1"))
        for path, methods in document["paths"].items()
        for method in methods
    ]


def filled(path: str, number: str = "0" * 12) -> str:
    return re.sub(r"\{[^}]+\}", "0", re.sub(r"\{[^}]+\}", number, path, count=1))


def test_every_route_and_role_is_as_the_table_says(asked: Site) -> None:
    wrong, seen = [], 0
    for method, path in routes(asked):
        if path.startswith("/health/"):
            continue
        needed = ROLES.index(expected(method, path))
        assert asked.ask(None, method, filled(path)).status_code == 401, (method, path)
        for rank, role in enumerate(ROLES):
            seen += 1
            if rank < needed:
                answer = asked.ask(role, method, filled(path))
            else:  # behind the same guard nothing, so that nothing is done
                answer = asked.ask_guard(role, method, filled(path))
            is_refused = answer.status_code == 403 and answer.json()["type"].endswith("role-too-low")
            if is_refused != (rank < needed):
                wrong.append((role, method, path, answer.status_code))
    assert wrong == []
    assert seen > 400


def test_the_specification_names_no_route_that_is_not_there(asked: Site) -> None:
    there = {f"{method} {path}" for method, path in routes(asked)}
    assert there >= TRAINERS | ADMINS | {f"POST {path}" for path in VIEWERS_POST}


def test_what_is_another_subjects_answers_like_what_is_missing(asked: Site) -> None:
    """Every route with an id in its path, and every list; ``meaningful``: an admin finds something there."""
    meaningful = 0
    bodies = {"compare": {"takes": []}, "name": {"name": "best"}, "note": {"note": "x"}}
    for method, path in routes(asked):
        kind = path.split("/")[1].removesuffix("s")
        own = {"subject": "name", "model": "model", "take": "take", "job": "job", "video": "take"}.get(kind)
        if own is None or "{" not in path or path.endswith(("/events", "clocks/undo")):
            continue
        body = bodies.get(path.rsplit("/", 1)[1]) if method != "GET" else None
        for who in ("anna's trainer", "anna's viewer"):
            answers = [
                asked.ask(who, method, filled(path, one), json=body)
                for one in (asked.ids["ben"][own], "0" * len(asked.ids["ben"][own]))
            ]
            said = [
                (answer.status_code, re.sub(r"'[^']*'|[0-9a-f]{12,64}|\b0+\b|\bben\b", "_", answer.text))
                for answer in answers
            ]
            said = [(status, re.sub(r'"request_id": "[^"]*"', "", text)) for status, text in said]
            assert said[0] == said[1], (who, method, path)
        if method == "GET":
            meaningful += asked.ask("admin", method, filled(path, asked.ids["ben"][own])).status_code == 200
    assert meaningful >= 8
    for path in ("/subjects", "/takes", "/models", "/jobs", "/overview"):
        answer = asked.ask("anna's trainer", "GET", path)
        assert answer.status_code == 200, answer.text
        assert not re.search(r"\bben\b", answer.text), path
        assert path == "/overview" or "anna" in answer.text
    assert len(asked.store.takes.list()) == 2


def test_nothing_is_made_or_changed_for_another_subject(asked: Site) -> None:
    for method, path, body in (
        ("POST", "/subjects", {"name": "carla"}),
        ("PUT", "/subjects/ben/hand", {"hand": "left", "dimensions": {}}),
        ("POST", "/models/train", {"subject": "ben"}),
        ("POST", f"/models/{asked.ids['ben']['model']}/activate", None),
        ("DELETE", f"/takes/{asked.ids['ben']['take']}", None),
        ("DELETE", f"/models/{asked.ids['ben']['model']}", None),
    ):
        assert asked.ask("anna's trainer", method, path, json=body).status_code in (404, 422), path
    assert [subject.name for subject in asked.store.subjects.list()] == ["anna", "ben"]
    assert asked.store.subjects.get("ben").hand == "unknown"
    assert asked.store.takes.get(asked.ids["ben"]["take"]).subject == "ben"


def test_a_revoked_key_opens_nothing_from_the_next_request_on(asked: Site) -> None:
    made = asked.ask("admin", "POST", "/keys", json={"name": "short-lived", "role": "viewer"}).json()
    asked.proofs["short-lived"] = bearer(made["key"])
    assert asked.ask("short-lived", "GET", "/subjects").status_code == 200
    assert asked.ask("short-lived", "GET", "/keys").status_code == 403
    assert asked.ask("admin", "DELETE", "/keys/short-lived").json()["revoked_at"]
    assert asked.ask("short-lived", "GET", "/subjects").status_code == 401
    listed = asked.ask("admin", "GET", "/keys").text
    assert "short-lived" in listed
    assert made["key"] not in listed
    again = asked.ask("admin", "POST", "/keys", json={"name": "short-lived", "role": "viewer"})
    assert again.status_code == 409
    both = asked.ask("admin", "POST", "/keys", json={"name": "odd", "role": "admin", "subjects": ["anna"]})
    assert "an admin is of all subjects" in both.json()["detail"]


@pytest.mark.parametrize(
    "header", ["", "Bearer", "Bearer glk_", "Basic YTpi", "Bearer " + "glk_" + "A" * 5000]
)
def test_what_is_no_key_is_told_how_to_get_one(asked: Site, header: str) -> None:
    answer = asked.http.get("/subjects", headers={"Authorization": header})
    assert answer.status_code == 401
    assert answer.headers["www-authenticate"] == "Bearer"
    assert "glovecal key add NAME" in answer.json()["detail"]


def test_a_page_asks_for_a_key_once(asked: Site) -> None:
    address = "http://localhost"
    sent = asked.http.get(f"{address}/studio/live")
    assert (sent.status_code, sent.headers["location"]) == (303, "/login?page=/studio/live")
    page = asked.http.get(f"{address}{sent.headers['location']}")
    assert page.status_code == 200
    assert 'value="/studio/live"' in page.text
    wrong = asked.http.post(f"{address}/login", data={"key": "glk_no", "page": "/studio"})
    assert wrong.status_code == 401
    assert "no key of this service" in wrong.text
    form = {"key": asked.keys["viewer"], "page": "https://evil.example/studio"}
    let_in = asked.http.post(f"{address}/login", data=form)
    assert (let_in.status_code, let_in.headers["location"]) == (303, "/")
    cookie = let_in.headers["set-cookie"]
    assert "HttpOnly" in cookie
    assert "SameSite=strict" in cookie
    token = let_in.cookies[SESSION_COOKIE]
    asked.http.cookies.clear()
    with_it = {"Cookie": f"{SESSION_COOKIE}={token}"}
    assert asked.http.get("/subjects", headers=with_it).status_code == 200
    assert asked.http.post("/subjects", headers=with_it, json={"name": "x"}).status_code == 403
    assert asked.http.delete(f"{address}/login", headers=with_it).status_code == 204
    assert asked.http.get("/subjects", headers=with_it).status_code == 401
    asked.http.cookies.clear()


def test_who_changed_what_is_written_down(tmp_path: Path) -> None:
    with site(tmp_path / "data") as own:
        begun = own.ask("admin", "GET", "/audit/check").json()["entries"]
        changed = own.ask(
            "anna's operator", "PUT", "/subjects/anna/hand", json={"hand": "left", "dimensions": {}}
        )
        assert changed.status_code == 200, changed.text
        assert own.ask("viewer", "GET", "/audit").status_code == 403
        newest = own.ask("admin", "GET", "/audit", params={"limit": 1}).json()[0]
        assert (newest["who"], newest["action"]) == ("anna-operator", "PUT /v1/subjects/anna/hand")
        assert newest["changes"] == [
            {"table": "subjects", "key": "anna", "before": {"hand": "unknown"}, "after": {"hand": "left"}}
        ]
        assert own.ask("admin", "GET", "/audit/check").json() == {"entries": begun + 1, "problems": []}
        with own.store.database.engine.begin() as connection:
            connection.exec_driver_sql("UPDATE audit SET who = 'nobody' WHERE id = 2")
        assert own.ask("admin", "GET", "/audit/check").json()["problems"] == [
            "entry 2 was changed after it was written"
        ]


def test_on_loopback_nobody_is_asked(tmp_path: Path) -> None:
    app = create_app(Settings(data=tmp_path / "data"))
    with (
        start_blocking_portal() as portal,
        portal.wrap_async_context_manager(app.router.lifespan_context(app)),
        httpx.Client(transport=PortalTransport(app, portal), base_url="http://localhost/v1") as http,
    ):
        assert http.post("/subjects", json={"name": "anna"}).status_code == 201
        assert http.get("/audit").json()[0]["who"] == "this computer"
