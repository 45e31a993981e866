"""``glovecal serve`` of a site: no step beyond loopback without certificates, with them TLS everywhere."""

from __future__ import annotations

import os
import select
import signal
import socket
import ssl
import subprocess
import sys
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import httpx
import psutil
import pytest
from served_site import GLOVECAL, Served
from site_support import eventually

from glovecal_client import open_client
from glovecal_client.keys import all_services
from glovecal_client.rest import NoService, RestClient
from glovecal_client.session import ask_json
from glovecal_client.site.certificates import client_context
from glovecal_client.site.member import read_member


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    served = Served(tmp_path_factory.mktemp("served"))
    assert served.run("site", "init", "--host", "lab.example").returncode == 0
    assert served.run("site", "add", "watcher", "--as", "viewer", "--role", "viewer").returncode == 0
    assert served.run("site", "add", "boss", "--as", "viewer", "--role", "admin").returncode == 0
    service = str(served.place / "data" / "site" / "service.glovecal")
    process = subprocess.Popen(
        [*GLOVECAL, "serve", "--no-studio"],
        env=served.environment | {"GLOVECAL_SITE_FILE": service},
        text=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
    )
    assert process.stdout is not None
    assert process.stdout.readline().startswith("Glovecal is running")
    served.process = process  # type: ignore[attr-defined]
    try:
        yield served
    finally:
        process.kill()
        process.communicate(timeout=120)


def test_it_does_not_start_beyond_loopback_without_certificates(tmp_path: Path) -> None:
    served = Served(tmp_path)
    for more in ({}, {"GLOVECAL_HOST": "127.0.0.1"}, {"GLOVECAL_SITE_FILE": str(tmp_path / "none.glovecal")}):
        refused = served.run("serve", **more)
        assert refused.returncode == 1
        assert "glovecal site init --host NAME" in refused.stderr, more


def test_rest_is_encrypted_and_answers_to_its_names_alone(
    served: Served, monkeypatch: pytest.MonkeyPatch
) -> None:
    watcher = read_member(served.place / "watcher.glovecal")
    url = f"https://127.0.0.1:{served.port}"
    verified = httpx.Client(verify=client_context(watcher), base_url=url, trust_env=False)
    with verified as http:
        assert http.get("/v1/subjects").status_code == 401, "its certificate is no key"
        http.headers["Authorization"] = f"Bearer {watcher.api_key}"
        for host, status in (
            ("lab.example", 200), ("LAB.example:8600", 200), ("127.0.0.1", 200), ("evil.example", 421),
        ):  # fmt: skip
            assert http.get("/v1/subjects", headers={"Host": host}).status_code == status, host
        foreign = {"Host": "evil.example", "Origin": "https://evil.example"}
        assert http.post("/v1/subjects", json={"name": "eve"}, headers=foreign).status_code == 421
    with pytest.raises(NoService, match="GLOVECAL_SITE_FILE"), RestClient(url) as client:
        client.get("/subjects")
    monkeypatch.setenv("GLOVECAL_SITE_FILE", str(served.place / "watcher.glovecal"))
    with RestClient(url) as client:
        assert client.get("/subjects") == []
    with socket.create_connection(("127.0.0.1", served.port)) as plain, suppress(ConnectionResetError):
        plain.sendall(b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n")
        assert not plain.recv(100).startswith(b"HTTP/1.1 200")
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
    context.maximum_version = ssl.TLSVersion.TLSv1_2
    with socket.create_connection(("127.0.0.1", served.port)) as opened, context.wrap_socket(opened) as older:
        assert older.version() == "TLSv1.2"


def test_who_never_ends_the_tls_handshake_is_ended_before_who_never_sends_a_request(served: Served) -> None:
    address = ("127.0.0.1", served.port)
    context = client_context(read_member(served.place / "watcher.glovecal"))
    context.maximum_version = ssl.TLSVersion.TLSv1_2  # 1.3 sends tickets after its handshake
    with (
        context.wrap_socket(socket.create_connection(address), server_hostname="127.0.0.1") as silent,
        socket.create_connection(address) as half_open,
    ):
        ended, _, _ = select.select([silent, half_open], [], [], 120)
        assert ended == [half_open]
        assert half_open.recv(1) == b""


def test_verbs_find_the_service_by_the_file_alone_and_it_is_healthy(served: Served) -> None:
    file = {"GLOVECAL_SITE_FILE": str(served.place / "watcher.glovecal")}
    without = dict.fromkeys(("GLOVECAL_URL",), "")
    environment = {
        k: v for k, v in served.environment.items() if k not in ("GLOVECAL_ZENOH", "GLOVECAL_HOST")
    }
    document = read_member(Path(file["GLOVECAL_SITE_FILE"]))
    assert document.rest == f"https://lab.example:{served.port}"
    url = {"GLOVECAL_URL": f"https://localhost:{served.port}"}
    listed = subprocess.run([*GLOVECAL, "subject", "list"], env=environment | without | file | url,
                            capture_output=True, text=True, check=False)  # fmt: skip
    assert (listed.returncode, listed.stderr) == (0, "")
    check = [sys.executable, "-P", "-m", "glovecal_service.health_check"]
    asked = subprocess.run(check, env=served.environment | file, capture_output=True, text=True, check=False)
    assert asked.stdout == "Healthy: real time, recorder, web.\n"


def test_a_real_time_process_that_was_killed_has_its_rules_again(
    served: Served, monkeypatch: pytest.MonkeyPatch
) -> None:
    served.run("site", "add", "gone", "--as", "viewer")
    served.run("site", "revoke", "gone")
    endpoint = served.zenoh.replace("0.0.0.0", "127.0.0.1")
    monkeypatch.setenv("GLOVECAL_SITE_FILE", str(served.place / "data" / "site" / "service.glovecal"))
    status = all_services("lab").removesuffix("alive") + "status"

    def process_id() -> int:
        with open_client([endpoint], wait_s=30) as session:
            return int(ask_json(session, status, timeout_s=30)["process"])

    killed = process_id()
    os.kill(killed, signal.SIGKILL)
    eventually(lambda: not psutil.pid_exists(killed) or process_id() != killed, "another real-time process")
    assert process_id() != killed
    told = served.run(
        "watch", "right", "--seconds", "1", "--connect", endpoint,
        GLOVECAL_SITE_FILE=str(served.place / "gone.glovecal"),
    )  # fmt: skip
    assert told.returncode != 0
    assert "it was revoked" in told.stderr


def test_site_verbs_tell_what_they_did(served: Served) -> None:
    again = served.run("site", "init")
    assert again.returncode == 1
    assert "there is a site" in again.stderr
    renewed = served.run("site", "renew", "watcher", "--to", "renewed.glovecal")
    assert renewed.returncode == 0, renewed.stderr
    assert read_member(served.place / "renewed.glovecal").role == "viewer"
    listed = served.run("site", "list").stdout
    assert "watcher" in listed
    assert "396 days left" in listed
