"""Names that must never reach the store: traversal, NUL, CR LF, percent-encoded and Unicode tricks."""

from __future__ import annotations

import json
import socket
from collections.abc import Callable, Iterator
from http.client import HTTPConnection

import httpx
import pytest

from glovecal_service.settings import Settings

NAMES = [
    "..",
    ".",
    "%2e%2e",
    "%2E%2E%2Fetc",
    "..%2f..%2fetc%2fpasswd",
    "a%00b",
    "%00",
    "a%0d%0aSet-Cookie:%20x=1",
    "a%0a",
    "%0d",
    "a%5cb",
    "..%5c..",
    "%c0%ae%c0%ae",
    "%ff%fe",
    "%ED%A0%80",
    "UPPER",
    "_x",
    "-x",
    "a" * 65,
    "a" * 3000,
    "%20",
    "a%20b",
    "a%3Bb",
    "a%25",
    "%e2%80%ae",
    "%EF%BD%81%EF%BD%82",
    "%7f",
    "con.",
    "~root",
    "*",
    "'%20OR%201=1--",
]
ROUTES = [
    ("GET", "/subjects/{}"),
    ("DELETE", "/subjects/{}"),
    ("GET", "/gloves/{}"),
    ("PUT", "/gloves/{}"),
    ("DELETE", "/gloves/{}"),
    ("PUT", "/gloves/{}/wearer"),
    ("GET", "/takes/{}"),
    ("DELETE", "/takes/{}"),
    ("PUT", "/takes/{}/reference"),
    ("GET", "/takes/{}/export"),
    ("GET", "/recordings/{}"),
    ("POST", "/recordings/{}/stop"),
    ("GET", "/models/{}"),
    ("GET", "/models/{}/lineage"),
    ("POST", "/models/{}/activate"),
    ("GET", "/models/{}/export"),
    ("POST", "/models/{}/predict"),
    ("POST", "/models/{}/compare"),
    ("GET", "/cameras/{}"),
    ("POST", "/cameras/{}/stop"),
    ("PUT", "/cameras/{}/stage"),
    ("POST", "/cameras/{}/balance"),
    ("GET", "/cameras/{}/picture"),
    ("GET", "/jobs/{}"),
    ("GET", "/jobs/{}/events"),
    ("POST", "/jobs/{}/cancel"),
]


@pytest.fixture(scope="module")
def connection(
    serve: Callable[..., str], tmp_path_factory: pytest.TempPathFactory
) -> Iterator[HTTPConnection]:
    """Real HTTP, by a client that sends paths as they stand (httpx would resolve ``..`` by itself)."""
    url = serve(Settings(data=tmp_path_factory.mktemp("names") / "data"))
    connection = HTTPConnection(url.removeprefix("http://"), timeout=120)
    yield connection
    connection.close()


@pytest.mark.parametrize("name", NAMES)
def test_no_route_takes_the_name(connection: HTTPConnection, name: str) -> None:
    for method, route in ROUTES:
        connection.request(method, "/v1" + route.format(name))
        answer = connection.getresponse()
        text = answer.read().decode()
        assert answer.status in (404, 415, 422), (method, route, name, text)
        problem = json.loads(text)
        assert answer.headers["content-type"] == "application/problem+json"
        assert problem["type"].startswith("urn:glovecal:problem:")
        assert "Traceback" not in text


@pytest.mark.parametrize(
    "target",
    [b"/v1/subjects/\xff\xfe", b"/v1/subjects/a\x00b", b"/v1/../v1/subjects", b"//v1//subjects", b"*"],
)
def test_raw_bytes_in_the_request_line(connection: HTTPConnection, target: bytes) -> None:
    with socket.create_connection((connection.host, connection.port), timeout=120) as raw:
        raw.sendall(b"GET " + target + b" HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n")
        answer = b"".join(iter(lambda: raw.recv(65536), b""))
    assert answer.startswith((b"HTTP/1.1 400", b"HTTP/1.1 404")), answer


@pytest.mark.parametrize(
    "name", ["../x", "a/b", "a\x00", "a\r\nb", "", "\u212a", "a" * 65, "é", "\ud800", "a b"]
)
def test_no_body_takes_the_name(http: httpx.Client, name: str) -> None:
    bodies = [
        ("POST", "/subjects", {"name": name}),
        ("PUT", "/gloves/g1/wearer", {"subject": name}),
        ("POST", "/recordings", {"glove": name, "name": "n"}),
        ("POST", "/cameras", {"glove": name, "source": "rendered"}),
        ("POST", "/models/train", {"subject": name, "layout": "cyberglove18"}),
        ("POST", "/models/train", {"subject": "anna", "layout": name}),
        ("POST", "/models/rollback", {"subject": name, "layout": "cyberglove18"}),
    ]
    for method, path, body in bodies:
        answer = http.request(
            method, path, content=json.dumps(body), headers={"Content-Type": "application/json"}
        )
        assert answer.status_code == 422, (path, answer.text)
        assert answer.json()["errors"]


@pytest.mark.parametrize(
    "name", ["../../etc/passwd", "..", "a\\b.csv", "a\x00.csv", "x\n.csv", ".hidden", "y" * 201]
)
def test_file_names_are_only_names(http: httpx.Client, name: str) -> None:
    answer = http.post(
        "/takes",
        params={"subject": "anna", "filename": name},
        content=b"time_s\n",
        headers={"Content-Type": "text/csv"},
    )
    assert answer.status_code == 422
    assert answer.json()["errors"][0]["location"] == "query.filename"
