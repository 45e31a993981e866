"""The WebSocket bridge as a process, read by clients of its own, and by a page in a browser."""

from __future__ import annotations

import functools
import http.server
import json
import socket
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
import pytest
from bridge_support import FIST, FLAT, Stage, running_bridge
from playwright.sync_api import Page
from realtime_support import eventually
from websockets.exceptions import InvalidStatus
from websockets.sync.client import ClientConnection, connect

from glovecal_client.wire.pose import PoseFlag, RotationFlag, decode_pose
from glovecal_models.hand.forward_kinematics import forward_kinematics
from glovecal_models.hand.rotations import FINGERS, HAND_ROTATIONS

EXAMPLES = Path(__file__).resolve().parents[3] / "client" / "examples"


def pose_with(
    opened: ClientConnection, is_wanted: Callable[[dict[str, Any]], bool], metas: dict[str, Any] | None = None
) -> dict[str, Any]:
    """The first pose that is wanted; notes what the metas on the way say."""
    while True:
        message = json.loads(opened.recv(timeout=120))
        if message["type"] == "meta" and metas is not None:
            metas[message["glove"]] = message["meta"]
        if message["type"] == "pose" and is_wanted(message):
            return message


def test_json_says_all_of_both_hands_and_stale_never_looks_live(stage: Stage) -> None:
    faulty = {"R_PIP": int(RotationFlag.FAULTY_SENSOR), "M_PIP": int(RotationFlag.TOO_UNCERTAIN)}
    stage.show(right={"angles": FIST, "rotation_flags": faulty}, left={"angles": {"I_PIP": 33.0}})
    with running_bridge(stage, "websocket", "--port", 0) as bridge:
        host, port = bridge.place()
        with connect(f"ws://{host}:{port}/") as opened:
            metas: dict[str, Any] = {}
            left = pose_with(opened, lambda each: each["glove"] == "left", metas)
            right = pose_with(opened, lambda each: each["glove"] == "right", metas)
            assert metas == {hand.glove: hand.meta for hand in stage.hands}
            assert (left["state"], left["degrees"]) == ("live", {**FLAT, "I_PIP": 33.0})
            assert (right["state"], right["degrees"]) == ("live", {**FLAT, **FIST})
            assert sorted(right["unusable"]) == ["M_PIP", "R_PIP"]
            assert set(right["sd_deg"].values()) == {1.0}
            assert right["age_ms"] == 0.8
            stage.show(right=None)
            stale = pose_with(opened, lambda each: each["glove"] == "right" and each["state"] != "live")
            assert (stale["state"], stale["flags"]) == ("stale", ["stale"])
            stage.show(right={"angles": FLAT})
            pose_with(opened, lambda each: each["glove"] == "right" and each["state"] == "live")
            stage.right.model = None
            bare = pose_with(opened, lambda each: each["glove"] == "right" and each["state"] != "live", metas)
            assert (bare["state"], bare["degrees"]) == ("uncalibrated", {})
            assert metas["right"]["rotations"] == []
        with connect(f"ws://{host}:{port}/left") as only:
            for _ in range(10):
                assert json.loads(only.recv(timeout=120))["glove"] == "left"
        counts = eventually(lambda: bridge.counts("left"), "a line of counts")
        taken = counts["received"] - counts["overtaken"]
        assert 0 < counts["sent"] <= 2 * taken, "for one receiver, later two"
        summary = bridge.end()
    assert summary["gloves"]["right"]["reconnects"] >= 1
    assert summary["gloves"]["left"]["sent"] > 0
    assert 0 < summary["added_ms"]["p50"] < summary["finger_to_wire_ms"]["p99"]


def test_binary_poses_are_those_of_the_wire(stage: Stage) -> None:
    stage.show(right={"angles": FIST, "flags": PoseFlag.SIMULATED})
    with running_bridge(stage, "websocket", "--port", 0, "--glove", "right") as bridge:
        host, port = bridge.place()
        with connect(f"ws://{host}:{port}/binary/right") as opened:
            meta = json.loads(opened.recv(timeout=120))
            assert meta == {"type": "meta", "glove": "right", "meta": stage.right.meta}
            message = opened.recv(timeout=120)
            assert isinstance(message, bytes)
            pose = decode_pose(message)
            assert dict(zip(HAND_ROTATIONS, pose.degrees.tolist(), strict=True)) == {**FLAT, **FIST}
            assert (pose.simulated, pose.stale, pose.run_id) == (True, False, stage.right.run_id)
            stage.show(right=None)
            eventually(lambda: decode_pose(bytes(opened.recv(timeout=120))).stale, "a stale pose")  # type: ignore[arg-type]


def test_pages_of_other_computers_are_refused(stage: Stage) -> None:
    stage.show(right={})
    allowed = "https://stage.example"
    with running_bridge(stage, "websocket", "--port", 0, "--option", f"origin={allowed}") as bridge:
        host, port = bridge.place()
        for origin in ("http://example.org", "null", f"http://localhost:{port}.example.org"):
            with pytest.raises(InvalidStatus, match="403"), connect(f"ws://{host}:{port}/", origin=origin):  # type: ignore[arg-type]
                pass
        for origin in ("http://localhost:8000", "http://127.0.0.1", allowed):
            with connect(f"ws://{host}:{port}/", origin=origin) as opened:  # type: ignore[arg-type]
                assert json.loads(opened.recv(timeout=120))["glove"] == "right"
        for path in ("/binary", "/a/b", "/UPPER"):
            with pytest.raises(InvalidStatus, match="404"), connect(f"ws://{host}:{port}{path}"):
                pass


def test_a_receiver_that_does_not_read_gets_the_newest_and_holds_up_nobody(stage: Stage) -> None:
    with running_bridge(stage, "websocket", "--port", 0, "--glove", "right") as bridge:
        host, port = bridge.place()
        address = f"ws://{host}:{port}/"
        narrow = socket.socket()
        narrow.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)  # a few poses wait in the system
        narrow.connect((host, port))
        with connect(address, max_queue=1, sock=narrow) as sleeping, connect(address) as reading:
            stage.show(right={"angles": FIST})

            def is_left_out() -> bool:
                reading.recv(timeout=120)
                for _ in range(50):
                    stage.right.put(FIST)
                return bool(bridge.counts("right").get("left_out"))

            eventually(is_left_out, "poses are left out for the one that does not read")
            stage.show(right={"angles": FLAT})
            pose_with(reading, lambda each: each["degrees"]["I_PIP"] == 0.0)
            newest = pose_with(sleeping, lambda each: each["degrees"]["I_PIP"] == 0.0)
            assert newest["state"] == "live"


@pytest.fixture
def example() -> Iterator[str]:
    """Where the example's page is served, as its first lines say."""
    handler = functools.partial(QuietHandler, directory=str(EXAMPLES))
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        serving = threading.Thread(target=server.serve_forever, daemon=True)
        serving.start()
        yield f"http://127.0.0.1:{server.server_address[1]}/hand.html"
        server.shutdown()
        serving.join()


class QuietHandler(http.server.SimpleHTTPRequestHandler):
    def log_message(self, format: str, *args: Any) -> None:
        pass


@pytest.fixture
def page(not_here: Callable[[str], NoReturn]) -> Iterator[Page]:
    from studio_support import running_browser

    try:
        with running_browser() as browser:
            yield browser.new_page()
    except FileNotFoundError as error:
        not_here(str(error))


PLACES = "glove => [hands[glove], states[glove]]"


@pytest.mark.needs_chromium
def test_the_example_draws_both_hands_where_they_are(stage: Stage, example: str, page: Page) -> None:
    assert len((EXAMPLES / "hand.html").read_text(encoding="utf-8").splitlines()) <= 60
    complaints: list[str] = []
    page.on("pageerror", lambda error: complaints.append(str(error)))
    measured = {name: angle for name, angle in FIST.items() if name != "T_IP"}
    stage.right.rotations = tuple(name for name in HAND_ROTATIONS if not name.endswith("_DIP"))
    stage.show(right={"angles": measured}, left={"angles": {"I_MCP": 20.0, "MR_ABD": 12.0, "RP_ABD": 8.0}})
    with running_bridge(stage, "websocket", "--port", 0) as bridge:
        host, port = bridge.place()
        page.goto(f"{example}?bridge=ws://{host}:{port}/")
        page.wait_for_function("hands.right && hands.left", timeout=120_000)
        dips = {f"{each}_DIP": 2 / 3 * measured[f"{each}_PIP"] for each in "IMRP"}
        require_places(page, stage.right, {**measured, **dips})
        require_places(page, stage.left, {"I_MCP": 20.0, "MR_ABD": 12.0, "RP_ABD": 8.0})
        before = page.locator("canvas").screenshot()
        stage.show(right={"angles": FLAT})
        page.wait_for_function("Math.abs(angles.right.I_PIP) < 1e-6", timeout=120_000)
        page.evaluate("() => new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")
        assert page.locator("canvas").screenshot() != before
        stage.show(right=None)
        page.wait_for_function("states.right === 'stale'", timeout=120_000)
        page.wait_for_function(
            "document.getElementById('state').textContent === 'left: live; right: stale'", timeout=120_000
        )
    page.wait_for_function("states.left === 'stale'", timeout=120_000)
    assert complaints == []


def require_places(page: Page, worn: Any, angles: dict[str, float]) -> None:
    places, state = page.evaluate(PLACES, worn.glove)
    assert state == "live"
    rows = np.array([[{**FLAT, **angles}[name] for name in HAND_ROTATIONS]])
    frames = forward_kinematics(worn.skeleton, rows.astype(np.float32).astype(float))
    for number, joint in enumerate(worn.skeleton.joints):
        np.testing.assert_allclose(places[joint.name], frames.joints_mm[0, number], atol=1e-4)
    for number, finger in enumerate(FINGERS.values()):
        np.testing.assert_allclose(places[finger], frames.tips_mm[0, number], atol=1e-4)
