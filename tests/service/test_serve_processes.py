"""``serve`` as a user runs it: one banner, parts that come back when killed, a clean end."""

from __future__ import annotations

import os
import re
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path

import httpx
import psutil
import pytest
from free_ports import free_endpoint, free_port
from postgres_server import PostgresServer
from realtime_support import WireGlove, eventually

from glovecal_client.errors import NoAnswer
from glovecal_client.keys import all_services
from glovecal_client.pose_subscriber import PoseSubscriber
from glovecal_client.session import ask_json, open_client
from glovecal_service.serve import serve
from glovecal_service.settings import Settings
from glovecal_service.store import data_folder_lock
from glovecal_service.store.data_folder_lock import DataFolderLock


def start(data: Path, endpoint: str, port: int, **more: str) -> subprocess.Popen[str]:
    environment = os.environ | {
        "GLOVECAL_DATA": str(data),
        "GLOVECAL_ZENOH": endpoint,
        "GLOVECAL_PORT": str(port),
        **more,
    }
    return subprocess.Popen(
        [sys.executable, "-m", "glovecal_service.cli.command", "serve"],
        env=environment,
        text=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )


@pytest.fixture
def serving(tmp_path: Path) -> Iterator[tuple[subprocess.Popen[str], str, int]]:
    endpoint, port = free_endpoint(), free_port()
    process = start(tmp_path / "data", endpoint, port)
    try:
        yield process, endpoint, port
    finally:
        if process.poll() is None:
            process.kill()
        process.communicate(timeout=120)


def test_a_log_that_nobody_reads_holds_nobody_up(serving: tuple[subprocess.Popen[str], str, int]) -> None:
    """Its pipe is full after some hundred requests."""
    _, endpoint, port = serving
    eventually(lambda: answers(endpoint), "real time")
    with httpx.Client(base_url=f"http://127.0.0.1:{port}/v1", timeout=60.0) as http:
        eventually(lambda: _is_up(http), "the web process")
        for _ in range(600):
            assert http.get("/health/live").is_success


def test_what_its_processes_log_reaches_the_log(
    serving: tuple[subprocess.Popen[str], str, int],
) -> None:
    """Each has a copy of the first one's streams, whose writing thread it does not have."""
    process, endpoint, port = serving
    eventually(lambda: is_ready(port), "ready")
    with open_client([endpoint]) as session, httpx.Client(base_url=f"http://127.0.0.1:{port}/v1") as http:
        glove = WireGlove(session, Settings(zenoh=endpoint, site="lab"), "right", subject="anna")

        def is_refused() -> bool:
            glove.say_meta()
            glove.send()
            return "no subject 'anna'" in http.get("/live-gloves").text

        eventually(is_refused, "the wearer is not known")
    process.send_signal(signal.SIGINT)
    log = process.communicate(timeout=120)[1]
    assert '"path": "/v1/health/ready"' in log
    assert re.search(r"glovecal\.realtime INFO glove right: .*no subject 'anna'", log)


def _is_up(http: httpx.Client) -> bool:
    try:
        return http.get("/health/live").is_success
    except httpx.TransportError:
        return False


def children(process: subprocess.Popen[str]) -> list[int]:
    return [child.pid for child in psutil.Process(process.pid).children()]


def answers(endpoint: str) -> int:
    """The process id the real-time process tells, 0 while it does not answer."""
    try:
        with open_client([endpoint], wait_s=0) as session:
            return int(ask_json(session, all_services("lab").removesuffix("alive") + "status")["process"])
    except NoAnswer:
        return 0


def is_ready(port: int) -> bool:
    try:
        return httpx.get(f"http://127.0.0.1:{port}/v1/health/ready").status_code == 200
    except httpx.TransportError:
        return False


def health(port: int) -> tuple[int, str]:
    """As a container engine asks: exit code, and what was said."""
    command = [sys.executable, "-P", "-m", "glovecal_service.health_check"]
    environment = os.environ | {"GLOVECAL_HOST": "0.0.0.0", "GLOVECAL_PORT": str(port)}
    asked = subprocess.run(command, env=environment, capture_output=True, text=True)
    return asked.returncode, asked.stdout


def listener(process: subprocess.Popen[str], port: int) -> int:
    """The child that listens on ``port``, 0 if there is none."""
    for child in children(process):
        with suppress(psutil.Error):  # it ends while it is looked at
            connections = psutil.Process(child).net_connections("tcp")
            if any(item.laddr.port == port and item.status == psutil.CONN_LISTEN for item in connections):
                return child
    return 0


def status_and_detail(port: int, route: str) -> tuple[int, str]:
    answer = httpx.get(f"http://127.0.0.1:{port}/v1/health/{route}", timeout=120.0)
    return answer.status_code, answer.json().get("detail", "")


@pytest.mark.skipif(sys.platform == "win32", reason="no process is halted there")
def test_it_is_healthy_only_while_each_of_its_processes_lives(tmp_path: Path) -> None:
    endpoint, port = free_endpoint(), free_port()
    assert health(port) == (1, f"Nothing answers as Glovecal on 127.0.0.1, port {port}, within 4 s.\n")
    process = start(tmp_path / "data", endpoint, port, GLOVECAL_REALTIME="2", GLOVECAL_RECORDERS="2")
    try:
        assert process.stdout is not None
        assert process.stdout.readline().startswith("Glovecal is running")
        assert health(port) == (0, "Healthy: real time, real time 2, recorder, recorder 2, web.\n")
        assert status_and_detail(port, "ready") == (200, "")
        by_start = sorted(children(process))
        for number, name in ((0, "real time"), (1, "real time 2"), (3, "recorder 2")):
            os.kill(by_start[number], signal.SIGSTOP)
            eventually(lambda: health(port)[0] == 1, f"{name} is missed")
            assert f"no sign of life ({name} for " in health(port)[1]
            assert status_and_detail(port, "ready")[0] == 503
            os.kill(by_start[number], signal.SIGCONT)
            eventually(lambda: health(port)[0] == 0, f"{name} is back")
            eventually(lambda: status_and_detail(port, "ready")[0] == 200, f"{name} works")
    finally:
        process.kill()
        process.communicate(timeout=120)


@pytest.mark.needs_postgres
def test_without_its_database_it_lives_and_is_not_ready(tmp_path: Path, own_postgres: PostgresServer) -> None:
    """Whoever restarts what does not live must not end the poses."""
    endpoint, port = free_endpoint(), free_port()
    process = start(tmp_path / "data", endpoint, port, GLOVECAL_DATABASE=own_postgres.new_database())
    try:
        assert process.stdout is not None
        assert process.stdout.readline().startswith("Glovecal is running")
        eventually(lambda: status_and_detail(port, "ready") == (200, ""), "ready")
        with open_client([endpoint]) as session, PoseSubscriber(session, "lab", "right") as poses:
            glove = WireGlove(session, Settings(), "right")

            def pose_comes() -> bool:
                glove.send()
                return poses.wait(0.02) is not None

            eventually(pose_comes, "the first pose")
            with own_postgres.hanging(), ThreadPoolExecutor(60) as people:
                asked = [people.submit(status_and_detail, port, "ready") for _ in range(60)]
                assert health(port) == (0, "Healthy: real time, recorder, web.\n"), "it waits for no thread"
                eventually(pose_comes, "poses go on")
                assert {answer.result()[0] for answer in asked} == {503}
            own_postgres.stop()
            eventually(lambda: status_and_detail(port, "ready")[0] == 503, "not ready")
            assert "the database does not work" in status_and_detail(port, "ready")[1]
            assert health(port) == (0, "Healthy: real time, recorder, web.\n")
            eventually(pose_comes, "poses go on")
            own_postgres.start_after_kill()
            eventually(lambda: status_and_detail(port, "ready") == (200, ""), "ready again")
    finally:
        process.kill()
        process.communicate(timeout=120)


def test_each_part_survives_the_death_of_the_others(serving: tuple[subprocess.Popen[str], str, int]) -> None:
    process, endpoint, port = serving
    assert process.stdout is not None
    banner = [process.stdout.readline() for _ in range(4)]
    assert banner[0].startswith("Glovecal is running")
    assert f"http://127.0.0.1:{port}" in banner[1]
    assert endpoint in banner[2]
    assert is_ready(port)
    first = answers(endpoint)
    web = listener(process, port)
    assert len({first, web, 0}) == 3

    os.kill(web, signal.SIGKILL)
    assert answers(endpoint) == first
    eventually(lambda: is_ready(port), "web is back")

    os.kill(first, signal.SIGKILL)
    assert is_ready(port)
    eventually(lambda: answers(endpoint) not in (0, first), "real time is back")

    all_children = children(process)
    process.send_signal(signal.SIGTERM)
    assert process.wait(120) == 0
    eventually(lambda: not any(map(psutil.pid_exists, all_children)), "nothing is left")


def test_poses_are_back_after_each_of_five_crashes(
    serving: tuple[subprocess.Popen[str], str, int],
) -> None:
    process, endpoint, _ = serving
    assert process.stdout is not None
    process.stdout.readline()
    router_port = int(endpoint.rpartition(":")[2])
    with open_client([endpoint]) as session, PoseSubscriber(session, "lab", "right") as poses:
        glove = WireGlove(session, Settings(), "right")

        def pose_comes() -> bool:
            glove.send()
            return poses.wait(0.02) is not None

        eventually(pose_comes, "the first pose")
        for _ in range(5):
            victim = eventually(lambda: listener(process, router_port), "real time listens")
            os.kill(victim, signal.SIGKILL)
            eventually(lambda victim=victim: listener(process, router_port) != victim, "it is dead")
            while poses.wait(0.0) is not None:
                pass
            eventually(pose_comes, "poses are back")


def taken(port: int) -> socket.socket | None:
    """A socket that listens on ``port``, None while another does."""
    try:
        return socket.create_server(("127.0.0.1", port))
    except OSError:
        return None


def test_as_many_processes_share_the_gloves_as_are_asked_for(tmp_path: Path) -> None:
    endpoint = free_endpoint()
    more = {"GLOVECAL_REALTIME": "2", "GLOVECAL_RECORDERS": "2"}
    process = start(tmp_path / "data", endpoint, free_port(), **more)
    try:
        assert process.stdout is not None
        assert process.stdout.readline().startswith("Glovecal is running")
        with open_client([endpoint]) as session:

            def there() -> bool:
                tokens = session.liveliness().get(all_services("lab"), timeout=5.0)
                names = [str(reply.ok.key_expr).split("/")[3] for reply in tokens if reply.ok is not None]
                kinds = sorted(name.partition("-")[0] for name in names)
                return kinds == ["realtime", "realtime", "recorder", "recorder"]

            eventually(there, "two of each are there")
    finally:
        process.kill()
        process.communicate(timeout=120)


def test_what_cannot_start_is_tried_more_and_more_rarely_and_says_why(
    serving: tuple[subprocess.Popen[str], str, int],
) -> None:
    process, endpoint, _ = serving
    assert process.stdout is not None
    assert process.stderr is not None
    process.stdout.readline()
    router_port = int(endpoint.rpartition(":")[2])
    victim = listener(process, router_port)
    process.send_signal(signal.SIGSTOP)  # it looks away while somebody else takes the port
    os.kill(victim, signal.SIGKILL)
    with eventually(lambda: taken(router_port), "the port is given up"):
        process.send_signal(signal.SIGCONT)
        ends: list[tuple[str, str]] = []
        while len(ends) < 4:
            pattern = r"real time ended \((.*)\); starting it again in (\S+) s"
            ends += re.findall(pattern, process.stderr.readline())
    assert f"zenoh cannot listen on 127.0.0.1:{router_port} (Address already in use)" in ends[-1][0]
    assert [wait for _, wait in ends] == ["0.1", "0.2", "0.4", "0.8"]
    eventually(lambda: answers(endpoint), "it starts once the port is free")
    for one in (*children(process), process.pid):  # as a terminal does that is closed
        os.kill(one, signal.SIGHUP)
    assert process.wait(120) == 0


def test_a_second_service_on_the_same_folder_is_refused_by_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Both would write the same recordings. The folder is free again once the first has ended."""
    monkeypatch.setattr(data_folder_lock, "ENDS_WITHIN_S", 0.2)
    settings = Settings(
        data=tmp_path, database=None, artifacts=None, zenoh=free_endpoint(), port=free_port(), site="lab"
    )
    with DataFolderLock(tmp_path) as first:
        first.say_who("process 4711 on studio, http://127.0.0.1:8600")
        assert serve(settings) == 1
    told = capsys.readouterr().err
    assert f"another service runs on the data folder {tmp_path} (process 4711 on studio" in told
    assert "stop that one, or choose another folder with GLOVECAL_DATA" in told
    with DataFolderLock(tmp_path):
        assert not (tmp_path / data_folder_lock.WHO).exists()


@pytest.mark.parametrize("taken", ["REST", "zenoh"])
def test_a_taken_port_is_one_sentence(tmp_path: Path, taken: str) -> None:
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        port = other.getsockname()[1]
        endpoint = f"tcp/127.0.0.1:{port}" if taken == "zenoh" else free_endpoint()
        process = start(tmp_path, endpoint, port if taken == "REST" else free_port())
        said, complained = process.communicate(timeout=120)
    assert process.returncode == 1
    assert said == ""
    assert len(complained.strip().splitlines()) == 1
    assert f"{taken} cannot listen on 127.0.0.1:{port}" in complained


def test_a_studio_that_is_not_installed_is_one_sentence(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "nicegui", None)
    settings = Settings(data=tmp_path, zenoh=free_endpoint(), port=free_port())
    assert serve(settings) == 1
    told = capsys.readouterr().err
    assert "the studio needs nicegui, which is not installed: " in told
    assert "glovecal serve --no-studio" in told
