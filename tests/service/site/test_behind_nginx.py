"""Pages and REST behind nginx with docker/nginx.conf: who asks is known, and nobody passes for another."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NoReturn

import httpx
import pytest
from pydantic import ValidationError
from served_site import GLOVECAL, Served
from site_support import eventually, free_port

from glovecal_client.site.certificates import client_context
from glovecal_client.site.member import read_member
from glovecal_service.rest.http.observation import SESSION_COOKIE
from glovecal_service.settings import Settings

sys.path.insert(0, str(Path(__file__).parents[1] / "studio"))

from studio_support import NO_CHROMIUM, installed_chromium, running_browser

CONF = Path(__file__).resolve().parents[3] / "docker" / "nginx.conf"
NAME = "glovecal.example"
PROXY, PERSON = "127.0.0.5", "127.0.0.9"
FORGED = {"X-Forwarded-For": "10.9.9.9", "X-Forwarded-Proto": "https"}
AROUND = """daemon off; pid nginx.pid; error_log error.log; USER
events {}
http { access_log off; client_body_temp_path body; proxy_temp_path proxy; fastcgi_temp_path fastcgi;
uwsgi_temp_path uwsgi; scgi_temp_path scgi; proxy_bind PROXY; include glovecal.conf; }
"""


class Proxied(Served):
    """A service with a studio, and nginx before it and before another that is not there."""

    def __init__(self, place: Path) -> None:
        super().__init__(place)
        self.proxy_port = free_port()
        self.environment |= {"GLOVECAL_ALLOWED_HOSTS": NAME, "GLOVECAL_PROXIES": PROXY}
        self.key = ""

    @property
    def host(self) -> str:
        return f"{NAME}:{self.proxy_port}"

    def configure(self) -> None:
        member = read_member(self.place / "data" / "site" / "service.glovecal")
        files = {
            "authority.pem": member.authority,
            "own.pem": member.certificate,
            "own.key": member.private_key,
        }
        for name, content in files.items():
            (self.place / name).write_text(content)
        text = CONF.read_text(encoding="utf-8")
        changes = (
            ("/etc/nginx/glovecal.example.pem", "own.pem"),
            ("/etc/nginx/glovecal.example.key", "own.key"),
            ("/etc/nginx/glovecal-authority.pem", "authority.pem"),
            ("listen 443 ssl", f"listen 127.0.0.1:{self.proxy_port} ssl"),
            ("server lab.example:8600", f"server 127.0.0.1:{self.port}"),
            ("server lab-2.example:8600", f"server 127.0.0.1:{free_port()}"),
        )
        for there, here in changes:
            assert text.count(there) == 1, there
            text = text.replace(there, here)
        (self.place / "glovecal.conf").write_text(text)
        user = "user root;" if os.geteuid() == 0 else ""
        (self.place / "nginx.conf").write_text(AROUND.replace("USER", user).replace("PROXY", PROXY))

    def client(self, port: int, *, person: str = PERSON, **headers: str) -> httpx.Client:
        """Somebody at an address, who asks the proxy or the service itself."""
        context = client_context(read_member(self.place / "boss.glovecal"))
        transport = httpx.HTTPTransport(verify=context, local_address=person)
        return httpx.Client(
            transport=transport, base_url=f"https://127.0.0.1:{port}", headers={"Host": self.host, **headers}
        )

    def origin(self, subject: str) -> str:
        """From where a subject was added, by the log of changes."""
        with self.client(self.port, Authorization=f"Bearer {self.key}") as http:
            entries = http.get("/v1/audit").json()
        [entry] = [each for each in entries if f"'{subject}'" in str(each["changes"])]
        assert entry["action"] == "POST /v1/subjects"
        return entry["origin"]


@pytest.fixture(scope="module")
def proxied(
    tmp_path_factory: pytest.TempPathFactory, not_here: Callable[[str], NoReturn]
) -> Iterator[Proxied]:
    nginx = shutil.which("nginx", path="/usr/sbin:/usr/local/sbin:/usr/bin")
    if nginx is None:
        not_here("nginx is not installed (Debian: apt-get install nginx-light)")
    proxied = Proxied(tmp_path_factory.mktemp("proxied"))
    for words in (
        ("site", "init", "--host", "lab.example", "--host", NAME),
        ("site", "add", "boss", "--as", "viewer", "--role", "admin"),
    ):
        assert proxied.run(*words).returncode == 0
    proxied.key = read_member(proxied.place / "boss.glovecal").api_key or ""
    proxied.configure()
    service = str(proxied.place / "data" / "site" / "service.glovecal")
    serving = subprocess.Popen(
        [*GLOVECAL, "serve"],
        env=proxied.environment | {"GLOVECAL_SITE_FILE": service},
        text=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
    )
    assert serving.stdout is not None
    assert serving.stdout.readline().startswith("Glovecal is running")
    command = [nginx, "-p", str(proxied.place), "-e", "error.log", "-c", "nginx.conf"]
    with subprocess.Popen(command) as passing:
        try:
            with proxied.client(proxied.proxy_port) as http:
                eventually(lambda: _is_healthy(http), "nginx passes on")
            yield proxied
        finally:
            passing.terminate()
            serving.kill()
            serving.communicate(timeout=120)


def _is_healthy(http: httpx.Client) -> bool:
    try:
        return http.get("/health").status_code == 200
    except httpx.TransportError:
        return False


def test_a_service_that_is_away_is_left_out(proxied: Proxied) -> None:
    """Some of these would be sent to it."""
    for number in range(8):
        with proxied.client(proxied.proxy_port, person=f"127.0.{number}.9") as http:
            assert http.get("/v1/health/live").status_code == 200
    assert "Connection refused" in (proxied.place / "error.log").read_text()


def test_the_log_of_changes_names_the_person_and_not_the_proxy(proxied: Proxied) -> None:
    key = {"Authorization": f"Bearer {proxied.key}"}
    asked = {
        "through": (proxied.proxy_port, {}), "through-forged": (proxied.proxy_port, FORGED),
        "beside-forged": (proxied.port, FORGED),
    }  # fmt: skip
    for name, (port, headers) in asked.items():
        with proxied.client(port, **key, **headers) as http:
            assert http.post("/v1/subjects", json={"name": name}).status_code == 201
        assert proxied.origin(name) == PERSON


def test_a_login_is_kept_by_a_secure_cookie_and_other_hosts_are_refused(proxied: Proxied) -> None:
    with proxied.client(proxied.proxy_port) as http:
        origin = {"Origin": f"https://{proxied.host}"}
        answer = http.post("/login", data={"key": proxied.key, "page": "/studio/live"}, headers=origin)
        assert (answer.status_code, answer.headers["Location"]) == (303, "/studio/live")
        assert re.match(rf"{SESSION_COOKIE}=.*; HttpOnly; .*; Secure", answer.headers["Set-Cookie"])
        elsewhere = {"Origin": "https://evil.example"}
        assert http.post("/login", data={"key": proxied.key}, headers=elsewhere).status_code == 403
        for host in ("evil.example", f"evil.example:{proxied.proxy_port}"):
            assert http.get("/v1/subjects", headers={"Host": host}).status_code == 421


def test_uploads_are_as_large_as_the_service_allows(proxied: Proxied) -> None:
    key = {"Authorization": f"Bearer {proxied.key}"}
    with proxied.client(proxied.proxy_port, **key) as http:
        large = http.post("/v1/uploads", content=b"1,2\n" * 5_000_000, headers={"Content-Type": "text/csv"})
        assert large.status_code == 201, large.text
        too_large = http.post("/v1/subjects", content=b" " * 9_000_000)
        assert too_large.status_code == 413
        assert too_large.json()["type"] == "urn:glovecal:problem:body-too-large"


@pytest.mark.parametrize("wrong", ["*", "proxy.example", "192.168.1.5/24", "0.0.0.0/0", "192.168.1.5;"])
def test_proxies_are_named_by_addresses_and_are_not_everybody(wrong: str) -> None:
    with pytest.raises(ValidationError, match=r"neither the address of a proxy|is everybody"):
        Settings(proxies=wrong)
    assert Settings(proxies=" 192.168.1.5, 172.18.0.0/16,fd00::/8").known_proxies[1] == "172.18.0.0/16"


def test_a_proxy_on_this_computer_lets_others_in_who_are_asked(tmp_path: Path) -> None:
    refused = Served(tmp_path).run(
        "serve", GLOVECAL_HOST="127.0.0.1", GLOVECAL_ZENOH="tcp/127.0.0.1:0", GLOVECAL_PROXIES="127.0.0.1"
    )
    assert refused.returncode == 1
    assert "there is no admin yet" in refused.stderr


@pytest.mark.needs_chromium
def test_pages_work_in_a_browser(proxied: Proxied, not_here: Callable[[str], NoReturn]) -> None:
    if installed_chromium() is None:
        not_here(NO_CHROMIUM)
    with running_browser(f"--host-resolver-rules=MAP {NAME} 127.0.0.1") as browser:
        context = browser.new_context(ignore_https_errors=True)
        context.set_default_timeout(120_000)
        page = context.new_page()
        sockets: list[str] = []
        page.on("websocket", lambda socket: sockets.append(socket.url))
        page.goto(f"https://{proxied.host}/studio/models")
        page.fill("input[name=key]", proxied.key)
        page.click("text=Log in with a key")
        page.wait_for_url("**/studio/models")
        page.wait_for_function("window.did_handshake === true")
        assert sockets
        assert all(url.startswith(f"wss://{proxied.host}/") for url in sockets)
        context.close()
