"""A sampling through the real service: REST, server-sent events, zenoh, the recorder; killed and resumed."""

from __future__ import annotations

import json
import os
import pty
import select
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, suppress
from functools import partial
from typing import Any

import httpx
import psutil
import pytest
from realtime_support import eventually

from glovecal_client.rest import Refused, RestClient
from glovecal_models.sampling.sampled_takes import REUSABLE
from glovecal_service.demo.processes import DemoPlace, demo_place, running_capture, running_service

GLOVE = "right"


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> DemoPlace:
    return demo_place(tmp_path_factory.mktemp("sampling"))


def put_on(place: DemoPlace) -> ExitStack:
    """A simulated person in a glove who does what is asked."""
    options = {"motion": "asked", "service": place.url, "rate_hz": "60", "seed": "1"}
    worn = ExitStack()
    worn.enter_context(running_capture(place, glove=GLOVE, subject="anna", wearing="w1", options=options))
    return worn


@pytest.fixture(scope="module")
def worn() -> Iterator[list[Any]]:
    gloves: list[ExitStack] = []
    yield gloves
    for glove in gloves:
        glove.close()


@pytest.fixture(scope="module")
def service(place: DemoPlace, worn: list[Any]) -> Iterator[RestClient]:
    """A running service with subject ``anna``, who has her glove on."""
    with running_service(place) as client:
        client.post("/subjects", {"name": "anna"})
        worn.append(put_on(place))
        eventually(lambda: client.get("/gloves")["seen"], "the glove is seen")
        yield client


def start(service: RestClient, **more: Any) -> str:
    return service.post("/sampling", {"glove": GLOVE, "subject": "anna", **more})["id"]


def in_phase(service: RestClient, id: str, phase: str) -> dict[str, Any]:
    def there() -> dict[str, Any] | None:
        view = service.get(f"/sampling/{id}")
        return view if view["phase"] == phase else None

    return eventually(there, phase)


def over(service: RestClient, id: str) -> dict[str, Any]:
    def stored() -> dict[str, Any] | None:
        view = service.get(f"/sampling/{id}")
        return None if view["open"] else view

    return eventually(stored, "the end")


def walk(service: RestClient, id: str, names: tuple[str, ...]) -> Iterator[str]:
    """Do the steps ``names`` and leave out the others; yields each name once its step is done."""
    answered, until = 0, time.monotonic() + 300
    while (view := service.get(f"/sampling/{id}"))["phase"] not in ("done", "stopped"):
        step, new = view["step"]["name"], view["say_number"] > answered
        assert time.monotonic() < until, view
        if view["phase"] == "waiting" and new:
            answered = view["say_number"]
            event = "go" if step in names else "skip"
            answered = max(
                answered, service.post(f"/sampling/{id}/{event}")["say_number"] - (event == "skip")
            )
        if view["phase"] == "judged" and step in good(service, id):
            yield step
            eventually(lambda: service.get(f"/sampling/{id}")["phase"] != "judged", "the next step")
        elif view["phase"] == "judged" and new:
            answered = service.post(f"/sampling/{id}/go")["say_number"]
        time.sleep(0.03)


def good(service: RestClient, id: str) -> list[str]:
    steps = service.get(f"/sampling/{id}")["steps"]
    return [step["name"] for step in steps if step["outcome"] == "good"]


def test_a_second_wearing_by_events_and_what_is_said(service: RestClient, place: DemoPlace) -> None:
    id = start(service, protocol="second_wearing")
    with pytest.raises(Refused, match=f"in sampling {id} already"):
        start(service)
    for verb in ("undo", "resume"):
        with pytest.raises(Refused) as refusal:
            service.post(f"/sampling/{id}/{verb}")
        assert refusal.value.status == 409
    said: list[str] = []
    for kind, data in server_sent(place, id):
        if kind == "say":
            said.append(data)
            # A busy computer loses frames, and a step with it: then once more.
            if "Step " in data or data.startswith("Repeat: "):
                leaves_out = "Bend all knuckles" in data
                service.post(f"/sampling/{id}/{'skip' if leaves_out else 'go'}")
    view = service.get(f"/sampling/{id}")
    assert view["phase"] == "done"
    assert [step["outcome"] for step in view["steps"]] == ["good"] * 4 + ["skipped"]
    assert said[0].startswith("Step 1 of 5. Open and close the hand")
    assert said[-1] == "Done. Thank you."
    assert {"Ready.", "Hold still.", "Good."} <= set(said)
    assert view["capture_of_s"] < 30  # a busy computer does steps again
    (take,) = [service.get(f"/takes/{take}") for take in view["takes"]]
    assert (take["wearing"], take["simulated"], take["rotations"]) == ("w1", True, [])
    assert take["accounting"]["sampling"]["steps"][0]["pose"] == "flat"


def server_sent(place: DemoPlace, id: str) -> Iterator[tuple[str, Any]]:
    """Events and their data until the sampling is over."""
    address = f"{place.url}/v1/sampling/{id}/events"
    with httpx.stream("GET", address, timeout=120, trust_env=False) as stream:
        kind = ""
        for line in stream.iter_lines():
            name, _, value = line.partition(": ")
            kind = value if name == "event" else kind
            if name == "data":
                yield kind, json.loads(value)


DONE = ("loosen", "flat-start", "flat-1", "fist-1", "IM_ABD+0", "IM_ABD+25")


def test_a_sampling_survives_the_death_of_the_recorder_and_a_pause(
    service: RestClient, place: DemoPlace
) -> None:
    """kill -9 in the middle of a step: it begins again, no step is lost, and the takes are whole."""
    own = {"widget_deg": {"IM_ABD": [0, 25]}, "pose_deg": {"flat": {"I_MCP": 3.0, "IM_ABD": 2.0}}}
    id = start(service, protocol="fk_only", order="fixed", **own)
    for done in walk(service, id, DONE):
        if done == "flat-start":
            kill_recorder(place)
        if done == "flat-1":
            service.post(f"/sampling/{id}/pause")
            before = good(service, id)
            service.post(f"/sampling/{id}/resume")
            assert good(service, id) == before
    view = over(service, id)
    assert (view["phase"], view["problem"]) == ("done", "")
    assert [step["name"] for step in view["steps"] if step["outcome"] == "good"] == list(DONE)
    takes = [service.get(f"/takes/{take}") for take in view["takes"]]
    told = [take["accounting"]["sampling"] for take in takes]
    assert [take["kind"] for take in told] == [
        "verification",
        *["fk_independent"] * (len(told) - 2),
        REUSABLE[1],
    ]
    assert [step["name"] for take in told for step in take["steps"]] == list(DONE[1:])
    assert told[1]["steps"][0]["angles"] == {"I_MCP": 3.0, "IM_ABD": 2.0}
    service.post("/subjects", {"name": "bert"})
    reused = service.post(f"/sampling/{id}/reuse", {"subject": "bert"})
    rough = [service.get(f"/takes/{take}")["accounting"]["sampling"] for take in reused["takes"]]
    assert {take["kind"] for take in rough} == set(REUSABLE)
    assert {(take["rough"], take["from_subject"]) for take in rough} == {(True, "anna")}
    assert len(reused["left_out"]) == 1


def test_the_order_is_random_unless_asked_otherwise_and_its_seed_is_kept(service: RestClient) -> None:
    names = {}
    for order, seed in (("random", None), ("random", 7), ("fixed", None)):
        id = start(service, protocol="fk_only", order=order, seed=seed)
        view = service.post(f"/sampling/{id}/stop")
        assert (view["seed"] is None) == (order == "fixed")
        assert seed in (None, view["seed"])
        assert view["repeatability"] is None
        names[order, seed] = [step["name"] for step in view["steps"]]
        over(service, id)
    assert names["random", 7][-1].endswith("-again")
    assert sorted(names["random", 7][:-1]) == sorted(names["fixed", None])
    assert names["random", None][:-1] != names["fixed", None]


def kill_recorder(place: DemoPlace) -> None:
    """kill -9 of the process that has a recording open."""
    recordings = str(place.folder / "glovecal-data" / "recordings")
    for process in psutil.process_iter():
        with suppress(psutil.Error):
            if any(file.path.startswith(recordings) for file in process.open_files()):
                process.kill()
                return
    raise AssertionError("nobody records")


def test_a_lost_glove_is_waited_for(service: RestClient, place: DemoPlace, worn: list[Any]) -> None:
    id = start(service, protocol="second_wearing")
    in_phase(service, id, "waiting")
    service.post(f"/sampling/{id}/go")
    in_phase(service, id, "recording")
    worn.pop().close()
    assert in_phase(service, id, "lost")["say"] == "Signal lost, waiting for the glove."
    worn.append(put_on(place))
    assert "Signal restored." in in_phase(service, id, "waiting")["say"]
    service.post(f"/sampling/{id}/stop")
    assert over(service, id)["phase"] == "stopped"
    assert service.get(f"/sampling/{id}")["takes"] == []


def test_the_active_protocol_asks_for_what_teaches_most(service: RestClient) -> None:
    """Free motion first; then steps are chosen from it, and what is left out is not proposed again."""
    id = start(service, protocol="active", widget_deg={"T_IP": []})
    done = walk(service, id, ("loosen",))
    assert next(done) == "loosen"
    asked = []
    for _ in range(3):
        view = eventually(partial(chosen, service, id, asked), "a step is chosen")
        asked.append(view["step"]["name"])
        assert view["expected"]["step"] == asked[-1]
        assert "Expected standard deviation in degrees: " in view["say"]
        service.post(f"/sampling/{id}/skip")
    assert len(set(asked)) == 3
    assert not any(name.startswith("T_IP") for name in asked)
    view = eventually(partial(chosen, service, id, asked), "one more")
    service.post(f"/sampling/{id}/undo")
    assert service.get(f"/sampling/{id}")["step"]["name"] == asked[-1]
    service.post(f"/sampling/{id}/stop")
    assert over(service, id)["phase"] == "stopped"


def chosen(service: RestClient, id: str, before: list[str]) -> dict[str, Any] | None:
    """The view once it asks for a chosen step that is none of ``before``."""
    view = service.get(f"/sampling/{id}")
    if view["phase"] != "waiting" or view["step"]["name"] in before:
        return None
    if view["step"]["kind"] in ("range", "verification"):
        service.post(f"/sampling/{id}/skip")
        return None
    return view


def test_a_glove_of_the_subjects_other_hand_is_sampled(service: RestClient) -> None:
    service.post("/subjects", {"name": "lefty", "hand": "left"})
    id = service.post("/sampling", {"glove": GLOVE, "subject": "lefty"})["id"]
    assert service.get(f"/sampling/{id}")["subject"] == "lefty"
    service.post(f"/sampling/{id}/stop")


class Terminal:
    """``glovecal`` in a terminal of its own: what it shows, and keys to press."""

    def __init__(self, place: DemoPlace, *arguments: str) -> None:
        self._ours, theirs = pty.openpty()
        command = [sys.executable, "-m", "glovecal_service.cli.command", *arguments]
        surroundings = place.environment | {"GLOVECAL_URL": place.url, "TERM": "xterm", "COLUMNS": "100"}
        self.process = subprocess.Popen(
            command, stdin=theirs, stdout=theirs, stderr=theirs, env=surroundings, start_new_session=True
        )
        os.close(theirs)
        self.shown = ""

    def press(self, key: str) -> None:
        os.write(self._ours, key.encode())

    def wait_for(self, words: str) -> None:
        """Until ``words`` come, after what was waited for before."""

        def came() -> bool:
            if select.select([self._ours], [], [], 0.05)[0]:
                with suppress(OSError):  # the other end is closed
                    self.shown += os.read(self._ours, 65536).decode(errors="replace")
            return words in self.shown

        eventually(came, f"{words!r} in {self.shown[-2000:]!r}")
        self.shown = self.shown.partition(words)[2]

    def close(self) -> int:
        code = self.process.wait(60)
        os.close(self._ours)
        return code


def test_the_command_walks_a_person_through_it_by_keys(service: RestClient, place: DemoPlace) -> None:
    terminal = Terminal(place, "sample", "--glove", GLOVE, "-s", "anna", "--protocol", "second_wearing")
    terminal.wait_for("Step 1 of 5. Open and close the hand")
    terminal.wait_for("% of a sensor's range (still: below 5 %)")
    terminal.press("u")
    terminal.wait_for("there is nothing to undo")
    terminal.press("s")
    terminal.wait_for("Skipped. Step 2 of 5.")
    terminal.press(" ")
    terminal.wait_for("Ready.")
    terminal.press("q")
    terminal.wait_for("Continue with: glovecal sample resume ")
    assert terminal.close() == 0
    (paused,) = service.get("/sampling", {"glove": GLOVE, "only_open": True})
    assert paused["phase"] == "paused"
    again = Terminal(place, "sample", "resume", paused["id"])
    again.wait_for("Step 2 of 5.")
    for _ in range(4):
        again.press("s")
        again.wait_for("Skipped." if _ < 3 else "Done. Thank you.")
    again.wait_for("0 takes of 0 steps")
    assert again.close() == 0


def test_without_a_terminal_nobody_can_press_a_key(service: RestClient, place: DemoPlace) -> None:
    command = [sys.executable, "-m", "glovecal_service.cli.command", "sample"]
    surroundings = place.environment | {"GLOVECAL_URL": place.url}

    def run(*arguments: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [*command, *arguments], env=surroundings, capture_output=True, text=True, stdin=subprocess.DEVNULL
        )

    refused = run("--glove", GLOVE, "-s", "anna")
    assert (refused.returncode, "use --trigger timer" in refused.stderr) == (1, True)
    assert run("--glove", GLOVE, "-s", "anna", "--widget", "IM_ABD:3").returncode == 2
    assert GLOVE in run("list").stdout
    assert "its takes are stored" in run("resume", service.get("/sampling")[0]["id"]).stderr
