"""A log in which nobody is named: whatever a line is made of, and of a whole service."""

from __future__ import annotations

import logging
import os
import re
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import httpx
import pytest
from hypothesis import given
from hypothesis import strategies as st
from realtime_support import WireGlove, eventually, free_endpoint

from glovecal_client.session import open_client
from glovecal_models.errors import BadInput
from glovecal_service.logs import KEY_FILE, Event, NamelessFormatter, Word, marks
from glovecal_service.settings import Settings

NAMES = st.from_regex(r"[a-zA-Z][a-zA-Z0-9_-]{6,20}", fullmatch=True).map(lambda name: f"Qz{name}")


def line(name: str, message: Any, *args: Any, exc_info: Any = None) -> str:
    record = logging.LogRecord(name, logging.WARNING, "", 0, message, args, exc_info)
    return NamelessFormatter(lambda text: f"~{len(text)}").format(record)


def raised(name: str) -> BaseException:
    """An error with causes, each of which names somebody."""
    try:
        try:
            raise KeyError(name)
        except KeyError as error:
            raise BadInput(f"no subject {name!r} in {name}.csv") from error
    except BadInput as error:
        return error


def trace_of(error: BaseException) -> Any:
    return type(error), error, error.__traceback__


@given(NAMES, st.sampled_from(["glovecal.recorder", "glovecal_client.pose_subscriber", "asyncio", "other"]))
def test_no_line_names_anybody(name: str, logger: str) -> None:
    error = raised(name)
    said = [
        line(logger, "glove %s: %s", name, error),
        line(logger, "%(who)s did %(what)r", {"who": name, "what": [name]}),
        line(logger, "%r, %s, %d", Path("/home") / name, {"name": name}, 3, exc_info=trace_of(error)),
        line(logger, "%s", Event("request", {"path": f"/v1/subjects/{name}"}, route="/v1/subjects/{name}")),
        line("asyncio", f"Task exception was never retrieved: {name}"),
        line("asyncio", error),
    ]  # fmt: skip
    assert [each for each in said if name in each] == []


def test_a_line_keeps_what_helps() -> None:
    error = raised("anna")
    said = line(
        "glovecal.recorder", "recording %s of %s %s after %.1f s: %s", "0f3a" * 8, "anna", Word("ended"),
        2.25, error, exc_info=trace_of(error),
    )  # fmt: skip
    assert f"recording {'0f3a' * 8} of ~4 ended after 2.2 s: BadInput ~" in said
    assert "BadInput, from:\n  tests.service.test_logs_without_names:" in said
    assert "KeyError, from:\n  tests.service.test_logs_without_names:" in said
    request = line("glovecal.rest", "%s", Event("request", {"path": "/v1/takes/anna"}, status=404))
    assert request.endswith('{"event": "request", "status": 404}')
    assert line("glovecal.x", "born %s", "197903021234").endswith("born ~12"), "no id that was made here"


def test_marks_are_the_same_after_each_start_and_of_each_folder(tmp_path: Path) -> None:
    first, again, other = marks(tmp_path / "a"), marks(tmp_path / "a"), marks(tmp_path / "b")
    assert first("anna") == again("anna") != other("anna")
    assert re.fullmatch("~[0-9a-f]{8}", first("anna"))
    assert (tmp_path / "a" / KEY_FILE).stat().st_mode & 0o077 == 0 or sys.platform == "win32"


def test_a_key_that_cannot_be_had_is_told(tmp_path: Path) -> None:
    (tmp_path / KEY_FILE).mkdir()
    with pytest.raises(BadInput, match=r"log-marks.key in the data folder, .*GLOVECAL_LOG_NAMES=yes"):
        marks(tmp_path)


def test_the_log_of_a_whole_service_names_nobody(tmp_path: Path) -> None:
    """A glove of somebody, requests that are refused, a recording."""
    person, worn, data = "wolfgangina", "zebediah-left", tmp_path / "data"
    endpoint, port = free_endpoint(), int(free_endpoint().rpartition(":")[2])
    environment = os.environ | {
        "GLOVECAL_DATA": str(data), "GLOVECAL_ZENOH": endpoint, "GLOVECAL_PORT": str(port),
        "GLOVECAL_LOG_NAMES": "no",
    }  # fmt: skip
    glovecal = [sys.executable, "-m", "glovecal_service.cli.command"]
    process = subprocess.Popen(
        [*glovecal, "serve", "--no-studio"], env=environment, text=True,
        stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
    )  # fmt: skip
    try:
        with httpx.Client(base_url=f"http://127.0.0.1:{port}/v1", timeout=120) as http:
            eventually(lambda: is_up(http), "the service")
            with open_client([endpoint], wait_s=120) as session:
                glove = WireGlove(session, Settings(zenoh=endpoint, site="lab"), worn, subject=person)

                def is_refused() -> bool:
                    glove.say_meta()
                    glove.send()
                    return f"no subject {person!r}" in http.get("/live-gloves").text

                eventually(is_refused, "the wearer is not known")
                assert http.post("/subjects", json={"name": person}).status_code == 201
                assert http.get(f"/subjects/{person}-twin").status_code == 404
                asked = http.post("/recordings", json={"glove": worn, "name": f"take of {person}"})
                assert asked.status_code == 201, asked.text
                recording = asked.json()["id"]

                def is_recorded() -> bool:
                    glove.send()
                    found = http.get(f"/recordings/{recording}").json()
                    return found["state"] == "recording" and found["facts"].get("recorded", 0) > 0

                eventually(is_recorded, "frames are recorded")
                assert http.post(f"/recordings/{recording}/stop").is_success
    finally:
        process.send_signal(signal.SIGINT)
        told = process.communicate(timeout=120)[1]
    assert not re.search(f"{person}|{worn}|zebediah", told, re.IGNORECASE), told
    mark = subprocess.run([*glovecal, "log-mark", worn], env=environment, text=True, capture_output=True)
    assert mark.stdout.split()[1] == worn
    assert f"glovecal.realtime INFO glove {mark.stdout.split()[0]}: " in told
    assert '"route": "/v1/subjects/{name}", "status": 404' in told
    assert "/v1/health" not in re.sub(r'"route": "[^"]*"', "", told), "paths are left out"


def is_up(http: httpx.Client) -> bool:
    try:
        return http.get("/health/ready").is_success
    except httpx.TransportError:
        return False
