"""People who log in with a name and a password: over REST, on the login page, and where somebody guesses."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import anyio
import anyio.lowlevel
import httpx
import pytest
from anyio.from_thread import start_blocking_portal
from hypothesis import given
from hypothesis import strategies as st

from glovecal_service.rest.app import create_app
from glovecal_service.rest.http import guesses, pauses
from glovecal_service.rest.http.guesses import Guesses
from glovecal_service.rest.http.observation import SESSION_COOKIE
from glovecal_service.rest.http.pauses import Pauses
from glovecal_service.rest.http.problem import Problem
from glovecal_service.rest.in_process import PortalTransport
from glovecal_service.settings import Settings
from glovecal_service.store.store import Store

PASSWORD, OTHER = "correct horse battery", "staple battery horse"
LOGIN = "http://localhost/login"


class Asked:
    """A service that asks who one is, asked by an admin's key, and by whoever logs in."""

    def __init__(self, http: httpx.Client, key: str, store: Store) -> None:
        self.http, self.store = http, store
        self._admin = {"Authorization": f"Bearer {key}"}

    def __call__(self, method: str, path: str, body: object = None) -> httpx.Response:
        return self.http.request(method, path, json=body, headers=self._admin)

    def log_in(self, name: str, password: str, page: str = "/studio") -> httpx.Response:
        self.http.cookies.clear()
        return self.http.post(LOGIN, data={"name": name, "password": password, "page": page})

    def with_session(self, token: str, path: str) -> int:
        self.http.cookies.clear()
        return self.http.get(path, headers={"Cookie": f"{SESSION_COOKIE}={token}"}).status_code


@pytest.fixture
def asked(tmp_path: Path) -> Iterator[Asked]:
    settings = Settings(data=tmp_path / "data", login="always")
    with Store.open(settings) as store:
        key = store.keys.create("boss", "admin")[1]
        app = create_app(settings, store)
        with (
            start_blocking_portal() as portal,
            portal.wrap_async_context_manager(app.router.lifespan_context(app)),
            httpx.Client(transport=PortalTransport(app, portal), base_url="http://localhost/v1") as http,
        ):
            yield Asked(http, key, store)


def test_an_admin_adds_somebody_who_logs_in_until_what_they_may_changes(
    asked: Asked, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.DEBUG)
    made = asked("POST", "/people", {"name": "Anna", "role": "operator", "password": PASSWORD})
    assert made.status_code == 201, made.text
    assert (made.json()["name"], made.json()["role"]) == ("anna", "operator")
    again = asked("POST", "/people", {"name": "boss", "role": "viewer", "password": PASSWORD})
    assert again.status_code == 409, "one name is one key or person: the log of changes names it"
    let_in = asked.log_in(" ANNA", PASSWORD, "/studio/models")
    assert (let_in.status_code, let_in.headers["location"]) == (303, "/studio/models")
    assert "HttpOnly" in let_in.headers["set-cookie"]
    assert "SameSite=strict" in let_in.headers["set-cookie"]
    changes: list[tuple[str, str, object]] = [
        ("PUT", "/people/anna", {"role": "viewer", "subjects": None}),
        ("PUT", "/people/anna/password", {"password": OTHER}),
        ("DELETE", "/people/anna", None),
    ]
    password = PASSWORD
    for method, path, body in changes:
        token = asked.log_in("anna", password).cookies[SESSION_COOKIE]
        assert asked.with_session(token, "/subjects") == 200
        assert asked.with_session(token, "/people") == 403
        assert asked(method, path, body).status_code == 200
        assert asked.with_session(token, "/subjects") == 401
        password = OTHER if path.endswith("/password") else password
    assert asked.log_in("anna", password).status_code == 401
    listed = asked("GET", "/people")
    assert listed.json()[0]["revoked_at"]
    everything = listed.text + made.text + asked("GET", "/audit").text + caplog.text
    for secret in (PASSWORD, OTHER, "argon2id$"):
        assert secret not in everything


def test_what_somebody_changes_is_theirs_in_the_log(asked: Asked) -> None:
    asked("POST", "/people", {"name": "anna", "role": "operator", "password": PASSWORD})
    token = asked.log_in("anna", PASSWORD).cookies[SESSION_COOKIE]
    asked.http.cookies.clear()
    session = {"Cookie": f"{SESSION_COOKIE}={token}"}
    assert asked.http.post("/subjects", headers=session, json={"name": "ben"}).status_code == 201
    assert asked("GET", "/audit").json()[0]["who"] == "anna"
    refused = asked.http.get("/keys", headers=session).json()["detail"]
    assert "anna has the role operator; this needs admin" in refused
    assert "glovecal person change anna --role admin" in refused


def test_somebody_changes_their_own_password(asked: Asked) -> None:
    asked("POST", "/people", {"name": "anna", "role": "viewer", "password": PASSWORD})
    token = asked.log_in("anna", PASSWORD).cookies[SESSION_COOKIE]

    def change(old: str, new: str, again: str) -> httpx.Response:
        form = {"name": "anna", "password": old, "new": new, "again": again}
        return asked.http.post(f"{LOGIN}/password", data=form)

    assert "New password" in asked.http.get(f"{LOGIN}/password").text
    assert change(OTHER, OTHER, OTHER).status_code == 401
    assert "differ" in change(PASSWORD, OTHER, OTHER + "!").text
    assert "5 characters; give one of 12" in change(PASSWORD, "short", "short").text
    assert asked.with_session(token, "/subjects") == 200
    assert "is changed" in change(PASSWORD, OTHER, OTHER).text
    assert asked.with_session(token, "/subjects") == 401
    newest = asked("GET", "/audit").json()[0]
    assert (newest["who"], newest["action"]) == ("anna", "POST /login/password")
    assert asked.log_in("anna", PASSWORD).status_code == 401
    assert asked.log_in("anna", OTHER).status_code == 303


@pytest.mark.parametrize(
    ("body", "sentence"),
    [
        ({"name": "anna", "role": "viewer", "password": "elevenchars"}, "11 characters; give one of 12"),
        ({"name": "anna-and-ben", "role": "viewer", "password": "anna-and-ben"}, "is the name"),
        ({"name": "anna", "role": "viewer", "password": 123456789012}, "give text"),
        ({"name": "anna", "role": "viewer"}, "password: it is missing"),
        ({"name": "anna", "role": "admin", "subjects": ["x"], "password": PASSWORD}, "an admin is of all"),
        ({"name": "anna", "role": "viewer", "subjects": ["nobody"], "password": PASSWORD}, "no subject"),
    ],
)
def test_what_cannot_be_added_is_told_without_the_password(
    asked: Asked, body: dict[str, object], sentence: str
) -> None:
    refused = asked("POST", "/people", body)
    assert refused.status_code in (404, 422)
    assert sentence in refused.json()["detail"]
    assert str(body.get("password", "none")) not in refused.text.replace("anna-and-ben'", "")
    assert asked.store.people.list() == []


@pytest.mark.parametrize("password", ["\x00" * 12, "😀" * 12, "%ff%00" * 9, "é" * 5000, ""])
def test_odd_passwords_are_wrong_and_nothing_else(asked: Asked, password: str) -> None:
    answer = asked.log_in("anna", password)
    assert answer.status_code == 401
    assert "do not belong together" in answer.text


def test_wrong_passwords_are_slowed_and_tell_nothing_of_who_there_is(asked: Asked) -> None:
    asked("POST", "/people", {"name": "anna", "role": "viewer", "password": PASSWORD})
    pages = {}
    for name in ("anna", "nobody"):
        answer = asked.log_in(name, OTHER)
        pages[name] = (answer.status_code, answer.text, sorted(set(answer.headers) - {"x-request-id"}))
    assert pages["anna"] == pages["nobody"]
    for _ in range(guesses.AT_ONCE - 2):
        assert asked.log_in("nobody", OTHER).status_code == 401
    slowed = asked.log_in("anna", PASSWORD)
    assert slowed.status_code == 429
    assert 1 <= int(slowed.headers["retry-after"]) <= guesses.ADDRESS_PAUSE_S
    assert "try again in" in slowed.text
    asked.http.cookies.clear()
    assert asked("GET", "/people").status_code == 200, "keys are not slowed"


@given(st.lists(st.floats(0.0, 30.0), min_size=1, max_size=80))
def test_of_wrong_ones_pass_a_handful_and_then_one_a_pause(steps_s: list[float]) -> None:
    at_s = 1000.0
    paces = Pauses(5.0, guesses.AT_ONCE, lambda: at_s)
    passed = 0
    for step_s in steps_s:
        at_s += step_s
        if paces.wait_s("anna") == 0.0:
            paces.count("anna")
            passed += 1
        else:
            assert paces.wait_s("anna") <= 5.0, "nobody waits longer"
    assert passed <= guesses.AT_ONCE + (at_s - 1000.0) / 5.0
    assert paces.wait_s("ben") == 0.0


def in_a_loop(work: Callable[[], object]) -> None:
    anyio.run(work)  # type: ignore[arg-type]


def test_strangers_lock_nobody_out() -> None:
    async def work() -> None:
        at_s = 0.0
        limit = Guesses(lambda: at_s)
        assert await limit.check("anna", "10.0.0.5", lambda: "anna") == "anna"
        for stranger in range(guesses.AT_ONCE):  # each from an address of its own
            assert await limit.check("anna", f"10.1.0.{stranger}", lambda: None) is None
        for stranger in range(50, 60):
            with pytest.raises(Problem, match="Too many wrong passwords"):
                await limit.check("anna", f"10.1.0.{stranger}", lambda: None)
        assert await limit.check("anna", "10.0.0.5", lambda: "anna") == "anna", "where it was right before"
        with pytest.raises(Problem, match=r"try again in [1-5] s"):
            await limit.check("anna", "10.0.0.6", lambda: "anna")
        at_s += guesses.NAME_PAUSE_S
        assert await limit.check("anna", "10.0.0.6", lambda: "anna") == "anna", "from a new place: in 5 s"

    in_a_loop(work)


def test_an_address_is_slowed_whatever_names_it_guesses() -> None:
    async def work() -> None:
        limit = Guesses(lambda: 0.0)
        for number in range(guesses.AT_ONCE):
            assert await limit.check(f"name-{number}", f"2001:db8::{number}", lambda: None) is None
        with pytest.raises(Problem) as refused:  # another address of the same subscriber
            await limit.check("one-more", "2001:db8::ffff", lambda: None)
        assert refused.value.status == 429
        assert await limit.check("one-more", "2001:db8:0:1::1", lambda: None) is None

    in_a_loop(work)


def test_what_is_remembered_of_guesses_is_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    for part in (guesses, pauses):
        monkeypatch.setattr(part, "MOST_REMEMBERED", 20)

    async def work() -> None:
        limit = Guesses(lambda: 0.0)
        for number in range(100):
            await limit.check(f"name-{number}", f"10.0.0.{number}", lambda: None)
            await limit.check("anna", f"10.0.0.{number}", lambda: "anna")
        for kept in (limit._names._free_at, limit._addresses._free_at, limit._usual):
            assert len(kept) == 20

    in_a_loop(work)


def test_passwords_are_checked_a_few_at_once_while_the_service_answers_others() -> None:
    async def work() -> None:
        limit = Guesses(lambda: 0.0)
        go_on, running, most = threading.Event(), [], []
        answers: list[object] = []
        refused: list[object] = []

        def check() -> str:
            running.append(1)
            most.append(len(running))
            go_on.wait()
            running.pop()
            return "right"

        async def one(number: int) -> None:
            try:
                answers.append(await limit.check(f"name-{number}", f"10.0.0.{number}", check))
            except Problem as problem:
                answers.append(problem.status)

        async with anyio.create_task_group() as group:
            for number in range(30):
                group.start_soon(one, number)
            for _ in range(100):  # all of them are asked before the first is checked
                await anyio.lowlevel.checkpoint()
            refused += answers
            go_on.set()
        assert refused == [503] * (30 - guesses.CHECKED_AT_ONCE - guesses.MOST_WAITING)
        assert answers.count("right") == guesses.CHECKED_AT_ONCE + guesses.MOST_WAITING
        assert max(most) <= guesses.CHECKED_AT_ONCE

    in_a_loop(work)
