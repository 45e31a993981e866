"""People whom a provider of OpenID Connect knows: one that others wrote, and one that lies in every way."""

from __future__ import annotations

import base64
import hashlib
import logging
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from http.server import BaseHTTPRequestHandler
from pathlib import Path
from threading import Event
from typing import Any
from urllib.parse import parse_qs, urlsplit

import httpx
import jwt
import pytest
from anyio.from_thread import start_blocking_portal

sys.path.insert(0, str(Path(__file__).parents[1]))

from oidc_providers import (
    CLIENT,
    SECRET,
    LyingProvider,
    lying_provider,
    others_provider,
    public_jwk,
    signed,
    signed_by_everybody,
)

from glovecal_client.operating_system import HAS_FILE_MODES
from glovecal_models.errors import BadInput
from glovecal_service.cli.terminal.connection import settings_of_environment
from glovecal_service.rest.app import create_app
from glovecal_service.rest.http import begun_logins, provider
from glovecal_service.rest.http.observation import SESSION_COOKIE
from glovecal_service.rest.http.provider import Provider
from glovecal_service.rest.in_process import PortalTransport
from glovecal_service.settings import Settings
from glovecal_service.store.store import Store

HOST = "http://localhost"
ROLES = "animators=operator,leads=admin"


class Service:
    """Asks who one is, and lets people of ``issuer`` in."""

    def __init__(self, http: httpx.Client, store: Store, key: str) -> None:
        self.http, self.store, self.key = http, store, key

    def begin(self, page: str = "/studio/models") -> httpx.Response:
        self.http.cookies.clear()
        return self.http.get("/login/oidc", params={"page": page})

    def come_back(self, **query: str) -> httpx.Response:
        return self.http.get("/login/oidc/callback", params=query)

    def as_admin(self, method: str, path: str, body: object = None) -> httpx.Response:
        return httpx.Client(transport=self.http._transport).request(
            method, f"{HOST}/v1{path}", json=body, headers={"Authorization": f"Bearer {self.key}"}
        )

    def status(self, token: str, path: str) -> int:
        client = httpx.Client(transport=self.http._transport)
        return client.get(f"{HOST}/v1{path}", headers={"Cookie": f"{SESSION_COOKIE}={token}"}).status_code


@contextmanager
def service(data: Path, issuer: str, **settings: Any) -> Iterator[Service]:
    secret = data.parent / f"{data.name}.secret"
    secret.write_text(f"{SECRET}\n")
    secret.chmod(0o600)
    given = {"oidc_client_id": CLIENT, "oidc_secret_file": secret, "oidc_roles": ROLES, "oidc_name": "Studio"}
    given = given | settings if issuer else settings
    chosen = Settings(data=data, login="always", oidc_issuer=issuer, **given)
    with Store.open(chosen) as store:
        key = store.keys.create("boss", "admin")[1]
        app = create_app(chosen, store)
        with (
            start_blocking_portal() as portal,
            portal.wrap_async_context_manager(app.router.lifespan_context(app)),
            httpx.Client(transport=PortalTransport(app, portal), base_url=HOST) as http,
        ):
            yield Service(http, store, key)


PEOPLE: tuple[dict[str, Any], ...] = (
    {"sub": "s-1", "preferred_username": "Anna.Müller@studio.example", "groups": ["animators", "other"]},
    {"sub": "s-2", "preferred_username": "boss", "groups": ["animators", "leads"]},
    {"sub": "s-3", "preferred_username": "carl", "groups": ["accountants"]},
)


@pytest.fixture(scope="module")
def others() -> Iterator[str]:
    with others_provider("127.0.0.1", *PEOPLE) as issuer:
        yield issuer


@pytest.fixture
def site(others: str, tmp_path: Path) -> Iterator[Service]:
    with service(tmp_path / "data", others) as running:
        yield running


def at_provider(begun: httpx.Response, sub: str, **form: str) -> dict[str, str]:
    """Somebody says there who they are; what the provider gives the browser for the way back."""
    assert begun.status_code == 303, begun.text
    answer = httpx.post(begun.headers["location"], data={"sub": sub, **form})
    address = answer.headers["location"]
    assert address.startswith(f"{HOST}/login/oidc/callback?")
    return {name: values[0] for name, values in parse_qs(urlsplit(address).query).items()}


def log_in(site: Service, sub: str) -> httpx.Response:
    return site.come_back(**at_provider(site.begin(), sub))


def test_who_has_a_role_at_the_provider_is_let_in_with_it(
    site: Service, others: str, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.DEBUG)
    assert (
        'href="/login/oidc?page=%2Fstudio%2Fmodels">Log in with Studio<'
        in site.http.get("/login?page=/studio/models").text
    )
    begun = site.begin()
    cookie = begun.headers["set-cookie"]
    for part in ("HttpOnly", "SameSite=lax", "Path=/login/oidc", "Max-Age=600"):
        assert part in cookie
    back = log_in(site, "s-1")
    assert back.status_code == 200, back.text
    assert back.headers["refresh"] == "0; url=/studio/models"
    kept = " ".join(back.headers.get_list("set-cookie"))
    assert "SameSite=strict" in kept
    assert 'glovecal_login=""' in kept, "the login is over"
    token = back.cookies[SESSION_COOKIE]
    assert (site.status(token, "/subjects"), site.status(token, "/people")) == (200, 403)
    (anna,) = site.as_admin("GET", "/people").json()
    assert (anna["name"], anna["role"], anna["issuer"]) == ("anna-muller", "operator", others)
    assert anna["password_changed_at"] is None
    session = {"Cookie": f"{SESSION_COOKIE}={token}"}
    assert site.http.post("/v1/subjects", headers=session, json={"name": "ben"}).status_code == 201
    newest, first = site.as_admin("GET", "/audit").json()[:2]
    assert (newest["who"], first["who"]) == ("anna-muller", "anna-muller")
    assert first["action"] == "GET /login/oidc/callback"
    assert site.store.audit.problems() == []
    refused = site.http.get("/v1/keys", headers=session).json()["detail"]
    assert f"anna-muller has the role operator, by the login at {others}" in refused
    again = log_in(site, "s-1")
    assert site.status(again.cookies[SESSION_COOKIE], "/subjects") == 200
    assert site.status(token, "/subjects") == 200, "the same role: the other browser stays logged in"
    assert len(site.as_admin("GET", "/people").json()) == 1
    everything = caplog.text + back.text + site.as_admin("GET", "/audit").text
    for secret in (SECRET, token):
        assert secret not in everything


def test_a_name_that_is_taken_gets_a_number_and_the_most_of_several_roles_counts(site: Service) -> None:
    token = log_in(site, "s-2").cookies[SESSION_COOKIE]
    (person,) = site.as_admin("GET", "/people").json()
    assert (person["name"], person["role"]) == ("boss-2", "admin")
    assert site.status(token, "/keys") == 200
    assert not site.store.people.has_admin, "nobody of the provider gets in while it is away"


def test_who_has_no_role_there_is_told_what_an_admin_does(site: Service) -> None:
    refused = log_in(site, "s-3")
    assert refused.status_code == 403
    assert "An admin puts your account there into a group that GLOVECAL_OIDC_ROLES names" in refused.text
    assert SESSION_COOKIE not in refused.cookies
    assert site.as_admin("GET", "/people").json() == []


def test_an_admin_limits_and_removes_somebody_of_a_provider(site: Service) -> None:
    site.store.subjects.create("ben")
    token = log_in(site, "s-1").cookies[SESSION_COOKIE]
    path = "/people/anna-muller"
    refused = site.as_admin("PUT", path, {"role": "admin", "subjects": None})
    assert refused.status_code == 422
    assert "the role of anna-muller comes from" in refused.json()["detail"]
    refused = site.as_admin("PUT", f"{path}/password", {"password": "correct horse battery"})
    assert "has no password here" in refused.json()["detail"]
    limited = site.as_admin("PUT", path, {"role": "operator", "subjects": ["ben"]})
    assert limited.json()["subjects"] == ["ben"]
    assert site.status(token, "/subjects") == 401
    token = log_in(site, "s-1").cookies[SESSION_COOKIE]
    assert site.as_admin("GET", "/people").json()[0]["subjects"] == ["ben"], "stays with the next login"
    assert site.as_admin("DELETE", path).status_code == 200
    assert site.status(token, "/subjects") == 401
    refused = log_in(site, "s-1")
    assert refused.status_code == 403
    assert "was removed by an admin" in refused.text


def test_an_answer_is_taken_once_from_the_browser_that_asked(site: Service) -> None:
    answer = at_provider(site.begin(), "s-1")
    own = dict(site.http.cookies)
    site.http.cookies.clear()
    for sealed in (None, "forged", "é"):
        stolen = {} if sealed is None else {"Cookie": f"glovecal_login={sealed}".encode("latin-1")}
        refused = site.http.get("/login/oidc/callback", params=answer, headers=stolen)  # type: ignore[arg-type]
        assert refused.status_code == 400
        assert "This browser did not begin that login" in refused.text
    site.begin()
    assert site.come_back(**answer).status_code == 400, "another login's cookie"
    cookie = {"Cookie": f"glovecal_login={own['glovecal_login']}"}
    site.http.cookies.clear()
    assert site.http.get("/login/oidc/callback", params=answer, headers=cookie).status_code == 200
    replayed = site.http.get("/login/oidc/callback", params=answer, headers=cookie)
    assert replayed.status_code == 400
    assert "was used before" in replayed.text
    begun = site.begin()
    state = parse_qs(urlsplit(begun.headers["location"]).query)["state"][0]
    twice = site.come_back(code=answer["code"], state=state)
    assert twice.status_code == 502
    assert "Studio does not take this login, which may be over or used before" in twice.text


def test_a_login_that_took_too_long_is_begun_again(site: Service, monkeypatch: pytest.MonkeyPatch) -> None:
    answer = at_provider(site.begin(), "s-1")
    monkeypatch.setattr(begun_logins, "LOGIN_LASTS_S", -1)
    assert site.come_back(**answer).status_code == 400


def test_who_stops_at_the_provider_reads_our_sentence(site: Service) -> None:
    begun = site.begin()
    (state,) = parse_qs(urlsplit(begun.headers["location"]).query)["state"]
    answer = at_provider(begun, "s-1", action="deny")
    assert answer["error"] == "access_denied"
    refused = site.come_back(**answer | {"state": state})
    assert refused.status_code == 403
    assert "Studio did not let you in, or you stopped there" in refused.text


@pytest.mark.parametrize(
    "page", ["https://evil.example/", "//evil.example", "/studio//evil", "/studio/\\evil", "javascript:x", ""]
)
def test_no_page_of_another_site_is_shown_afterwards(site: Service, page: str) -> None:
    back = site.come_back(**at_provider(site.begin(page), "s-1"))
    assert back.headers["refresh"] == "0; url=/"
    assert "evil" not in back.text


@pytest.fixture
def liar() -> Iterator[LyingProvider]:
    with lying_provider() as running:
        yield running


@pytest.fixture
def asking(liar: LyingProvider, tmp_path: Path) -> Iterator[Service]:
    with service(tmp_path / "data", liar.issuer) as running:
        yield running


def lied_to(asking: Service, liar: LyingProvider, **query: str) -> httpx.Response:
    begun = asking.begin()
    assert begun.status_code == 303, begun.text
    asked = parse_qs(urlsplit(begun.headers["location"]).query)
    liar.nonce = asked["nonce"][0]
    return asking.come_back(**({"code": "any", "state": asked["state"][0]} | query))


def test_what_is_asked_proves_who_asks(asking: Service, liar: LyingProvider) -> None:
    begun = asking.begin()
    asked = {name: values[0] for name, values in parse_qs(urlsplit(begun.headers["location"]).query).items()}
    assert (asked["response_type"], asked["code_challenge_method"]) == ("code", "S256")
    assert asked["scope"] == "openid profile"
    liar.nonce = asked["nonce"]
    assert asking.come_back(code="any", state=asked["state"]).status_code == 200
    _, form, headers = next(each for each in liar.asked if each[0] == "/token")
    digest = hashlib.sha256(form["code_verifier"].encode()).digest()
    assert base64.urlsafe_b64encode(digest).decode().rstrip("=") == asked["code_challenge"]
    assert form["redirect_uri"] == asked["redirect_uri"] == f"{HOST}/login/oidc/callback"
    pair = base64.b64decode(headers["authorization"].removeprefix("Basic ")).decode()
    assert pair == f"{CLIENT}:a%20secret%3A%20of%20the%20provider"
    assert [path for path, _, _ in liar.asked].count("/.well-known/openid-configuration") == 1, "kept"
    again = parse_qs(urlsplit(asking.begin().headers["location"]).query)
    for each in ("state", "nonce", "code_challenge"):
        assert again[each] != [asked[each]], "new ones each time"


def test_a_secret_is_sent_as_the_provider_takes_it(liar: LyingProvider, tmp_path: Path) -> None:
    liar.description = {"token_endpoint_auth_methods_supported": ["client_secret_post"]}
    with service(tmp_path / "one", liar.issuer) as asking:
        assert lied_to(asking, liar).status_code == 200
    form = next(form for path, form, _ in liar.asked if path == "/token")
    assert (form["client_id"], form["client_secret"]) == (CLIENT, SECRET)
    liar.asked.clear()
    with service(tmp_path / "two", liar.issuer, oidc_secret_file=None) as asking:
        assert lied_to(asking, liar).status_code == 200
    _, form, headers = next(each for each in liar.asked if each[0] == "/token")
    assert form["client_id"] == CLIENT
    assert "authorization" not in headers


OCTETS = {"kty": "oct", "k": base64.urlsafe_b64encode(b"x" * 32).decode(), "kid": "0", "alg": "HS256"}


def unsigned(claims: dict[str, Any]) -> str:
    return jwt.encode(claims, "", algorithm="none", headers={"kid": "0"})


def by_octets(claims: dict[str, Any]) -> str:
    return jwt.encode(claims, b"x" * 32, algorithm="HS256", headers={"kid": "0"})


@pytest.mark.parametrize(
    ("lie", "sentence"),
    [
        ({"claims": {"nonce": "other"}}, "answered another login"),
        ({"claims": {"nonce": None}}, "answered another login"),
        ({"claims": {"nonce": 7}}, "answered another login"),
        ({"claims": {"aud": "another"}}, "no proof for this service"),
        ({"claims": {"aud": ["another"]}}, "no proof for this service"),
        ({"claims": {"aud": [CLIENT, "another"]}}, "proof for another service"),
        ({"claims": {"azp": "another"}}, "proof for another service"),
        ({"claims": {"iss": "https://evil.example"}}, "no proof for this service"),
        ({"claims": {"iss": None}}, "no proof for this service"),
        ({"claims": {"exp": 1_700_000_000}}, "sent a proof that is not of now"),
        ({"claims": {"exp": None}}, "no proof for this service"),
        ({"claims": {"iat": 4_000_000_000}}, "sent a proof that is not of now"),
        ({"claims": {"sub": None}}, "no proof for this service"),
        ({"claims": {"sub": "x" * 300}}, "does not say who this is"),
        ({"claims": {"sub": "a\x00b"}}, "does not say who this is"),
        ({"sign": unsigned}, "no proof for this service"),
        ({"sign": signed_by_everybody}, "no proof for this service"),
        ({"sign": by_octets, "keys": [OCTETS]}, "no proof for this service"),
        ({"sign": lambda claims: signed(claims, 1)}, "no proof for this service"),
        ({"sign": lambda claims: signed(claims)[:-8] + "AAAAAAAA"}, "no proof for this service"),
        ({"sign": lambda claims: "no.token"}, "no proof for this service"),
        ({"keys": []}, "no proof for this service"),
        ({"keys": ["x", 7, None]}, "no proof for this service"),
        ({"keys": [public_jwk(0), public_jwk(0)]}, "no proof for this service"),
    ],
)
def test_no_lie_lets_anybody_in(
    asking: Service, liar: LyingProvider, lie: dict[str, Any], sentence: str
) -> None:
    for name, value in lie.items():
        setattr(liar, name, value)
    refused = lied_to(asking, liar)
    assert refused.status_code == 502, refused.text
    assert sentence in refused.text
    assert SESSION_COOKIE not in refused.cookies
    assert asking.store.people.list() == []


def test_the_text_of_a_provider_is_never_shown(asking: Service, liar: LyingProvider) -> None:
    for error, shown in (("<b>evil</b>", "refused this login;"), ("invalid_scope", "login (invalid_scope);")):
        refused = lied_to(asking, liar, error=error, error_description="call 555-evil")
        assert refused.status_code == 502
        assert shown in refused.text
        assert "evil" not in refused.text


def test_new_keys_of_the_provider_are_taken_at_once(asking: Service, liar: LyingProvider) -> None:
    assert lied_to(asking, liar).status_code == 200
    liar.keys = [public_jwk(1)]
    liar.sign = lambda claims: signed(claims, 1)
    assert lied_to(asking, liar).status_code == 200


def test_a_role_of_this_login_ends_sessions_with_another(asking: Service, liar: LyingProvider) -> None:
    asking.store.subjects.create("ben")
    before = lied_to(asking, liar).cookies[SESSION_COOKIE]
    liar.claims = {"groups": "animators"}
    after = lied_to(asking, liar).cookies[SESSION_COOKIE]
    assert (asking.status(before, "/subjects"), asking.status(after, "/subjects")) == (401, 200)
    asking.as_admin("PUT", "/people/anna", {"role": "operator", "subjects": ["ben"]})
    liar.claims = {}
    refused = lied_to(asking, liar)
    assert refused.status_code == 403
    assert "glovecal person change anna --everybody" in refused.text
    for groups in (None, [], [7, None], {"leads": 1}, "Leads", True):
        liar.claims = {"groups": groups}
        assert lied_to(asking, liar).status_code == 403


@pytest.mark.parametrize(("verified", "status"), [(True, 200), (False, 403), ("true", 403), (None, 403)])
def test_an_address_of_mail_gives_a_role_once_it_is_verified(
    liar: LyingProvider, tmp_path: Path, verified: object, status: int
) -> None:
    liar.claims = {"email": "anna@studio.example", "email_verified": verified}
    roles = {"oidc_claim": "email", "oidc_roles": "anna@studio.example=admin"}
    with service(tmp_path / "data", liar.issuer, **roles) as asking:
        assert lied_to(asking, liar).status_code == status


@pytest.mark.parametrize("preferred", ["", "con", "🙂", "../..", "a" * 200, "this computer", 7, None, "-_-"])
def test_any_preferred_name_becomes_one(asking: Service, liar: LyingProvider, preferred: object) -> None:
    liar.claims = {"preferred_username": preferred}
    assert lied_to(asking, liar).status_code == 200
    (person,) = asking.store.people.list()
    assert person.name != "con"
    assert 1 <= len(person.name) <= 64


def huge(request: BaseHTTPRequestHandler) -> None:
    request.send_response(200)
    request.end_headers()
    with suppress(OSError):
        for _ in range(1000):
            request.wfile.write(b" " * 100_000)


def packed(request: BaseHTTPRequestHandler) -> None:
    request.send_response(200)
    request.send_header("Content-Encoding", "gzip")
    request.end_headers()
    request.wfile.write(b"\x1f\x8b" + b"\x00" * 1000)


def elsewhere(request: BaseHTTPRequestHandler) -> None:
    request.send_response(302)
    request.send_header("Location", "http://127.0.0.1:1/")
    request.end_headers()


def failing(request: BaseHTTPRequestHandler) -> None:
    request.send_response(500)
    request.end_headers()
    request.wfile.write(b'{"issuer": "evil"}')


@pytest.mark.parametrize("path", ["/.well-known/openid-configuration", "/keys", "/token"])
@pytest.mark.parametrize("lie", [huge, packed, elsewhere, failing])
def test_answers_that_are_none_are_told_in_a_sentence(
    asking: Service, liar: LyingProvider, path: str, lie: Any
) -> None:
    liar.answers[path] = lie
    answer = lied_to(asking, liar) if path != "/.well-known/openid-configuration" else asking.begin()
    assert answer.status_code == 502
    assert 'role="alert">Studio ' in answer.text
    assert "evil" not in answer.text
    liar.answers.clear()
    assert lied_to(asking, liar).status_code == 200, "it is asked anew"


@pytest.mark.parametrize(
    "description",
    [
        {"issuer": "https://evil.example"},
        {"token_endpoint": "http://evil.example/token"},
        {"authorization_endpoint": "javascript:alert(1)"},
        {"authorization_endpoint": "https://evil.example/\r\nSet-Cookie: a=b"},
        {"jwks_uri": None},
        {"jwks_uri": 7},
    ],
)
def test_a_description_that_leads_elsewhere_is_not_followed(
    asking: Service, liar: LyingProvider, description: dict[str, Any]
) -> None:
    liar.description = description
    answer = asking.begin()
    assert answer.status_code == 502
    assert "location" not in answer.headers
    assert "evil" not in answer.text


def test_a_provider_that_is_away_or_slow_stops_nobody_else(
    asking: Service, liar: LyingProvider, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In the suite it is given less time than the 8 s of a user."""
    assert provider.PROVIDER_TIMEOUT_S < 10
    go_on = Event()

    def dripping(request: BaseHTTPRequestHandler) -> None:
        request.send_response(200)
        request.end_headers()
        with suppress(OSError):
            while not go_on.wait(0.05):
                request.wfile.write(b" ")

    liar.answers["/.well-known/openid-configuration"] = dripping
    with ExitStack() as waiting:
        waiting.callback(go_on.set)
        monkeypatch.setattr(provider, "PROVIDER_TIMEOUT_S", 1.0)
        slow = asking.begin()
        assert slow.status_code == 503
        assert "Studio does not answer. Try again later; keys and passwords are taken" in slow.text
        began = time.monotonic()
        let_in = asking.http.post("/login", data={"key": asking.key, "page": "/studio/models"})
        assert let_in.status_code == 303
        assert time.monotonic() - began < 60, "asks no provider"
        page = asking.http.get("/login").text
        assert "Log in with Studio" in page


def test_a_provider_that_is_not_there_is_told(tmp_path: Path) -> None:
    with service(tmp_path / "data", "http://127.0.0.1:1") as asking:
        answer = asking.begin()
        assert answer.status_code == 503
        assert "Studio does not answer" in answer.text


ISSUER = {"ISSUER": "https://login.example", "CLIENT_ID": "x", "ROLES": "leads=admin"}


@pytest.mark.parametrize(
    ("variable", "value", "sentence"),
    [
        ("ISSUER", "http://login.example", "give the provider's address, https://HOST"),
        ("ISSUER", "login.example", "give the provider's address, https://HOST"),
        ("ISSUER", "https://login.example/?a=b", "give the provider's address, https://HOST"),
        ("ISSUER", "https://[", "give the provider's address, https://HOST"),
        ("ISSUER", "", "GLOVECAL_OIDC_CLIENT_ID is of no use without the address of a provider"),
        ("CLIENT_ID", "", "only with GLOVECAL_OIDC_CLIENT_ID"),
        ("ROLES", "", "only with GLOVECAL_OIDC_ROLES"),
        ("CLAIM", "", "only with GLOVECAL_OIDC_CLAIM"),
        ("ROLES", "leads=boss", "'leads=boss' gives no role; write VALUE=ROLE"),
        ("ROLES", "leads", "'leads' gives no role; write VALUE=ROLE"),
        ("ROLES", "=admin", "'=admin' gives no role; write VALUE=ROLE"),
        ("SECRET_FILE", "none", "cannot be read"),
        ("SECRET_FILE", "open", "others on this computer may read it (its mode is 644): chmod 600 "),
        ("SECRET_FILE", "empty", "must hold the secret in one line"),
        ("SECRET_FILE", "lines", "must hold the secret in one line"),
    ],
)
def test_settings_that_cannot_be_meant_are_refused(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, variable: str, value: str, sentence: str
) -> None:
    if value == "open" and not HAS_FILE_MODES:
        pytest.skip("a file has no mode here")
    monkeypatch.chdir(tmp_path)
    for name, content, mode in (("open", SECRET, 0o644), ("empty", "\n", 0o600), ("lines", "a\nb", 0o600)):
        Path(name).write_text(content)
        Path(name).chmod(mode)
    for name, right in (ISSUER | {variable: value}).items():
        monkeypatch.setenv(f"GLOVECAL_OIDC_{name}", right)
    with pytest.raises(BadInput) as refused:
        settings_of_environment()
    assert str(refused.value).startswith("GLOVECAL_OIDC_")
    assert sentence in str(refused.value)
    assert SECRET not in str(refused.value)


def test_settings_are_read_as_they_are_meant(monkeypatch: pytest.MonkeyPatch) -> None:
    for name, right in (ISSUER | {"ROLES": "lead animators=operator, cn=leads=admin,"}).items():
        monkeypatch.setenv(f"GLOVECAL_OIDC_{name}", right)
    settings = settings_of_environment()
    assert settings.oidc_roles == {"lead animators": "operator", "cn=leads": "admin"}
    assert Provider(settings).name == "login.example"


def test_without_a_provider_there_is_no_button_and_no_way(tmp_path: Path) -> None:
    with service(tmp_path / "data", "") as asking:
        assert "Log in with Studio" not in asking.http.get("/login").text
        for answer in (asking.begin(), asking.come_back(code="a", state="b")):
            assert answer.status_code == 404
            assert "GLOVECAL_OIDC_ISSUER" in answer.text
