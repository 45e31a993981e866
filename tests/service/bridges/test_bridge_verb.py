"""What all bridges share, by the command: the list, refusals, gloves that appear, a router that dies."""

from __future__ import annotations

import json
from contextlib import ExitStack

from bridge_support import RunningBridge, Stage, WornHand, refused, running_bridge
from cli_running import glovecal
from realtime_support import eventually, free_endpoint
from websockets.sync.client import connect

from glovecal_client.session import open_client, open_router
from glovecal_service.bridges.catalogue import BRIDGES


def test_without_a_name_it_lists_what_there_is() -> None:
    listed = glovecal({}, "bridge")
    assert all(f"\n{name} " in listed.out for name in BRIDGES)
    rows = json.loads(glovecal({}, "bridge", "--json").out)
    assert [row["name"] for row in rows] == list(BRIDGES)
    explained = glovecal({}, "bridge", "--help").out
    assert "HOST:PORT of the ROS 2 router" in " ".join(explained.split())


def test_what_cannot_be_is_refused_with_what_can(stage: Stage) -> None:
    assert "no bridge 'websockets'; did you mean 'websocket'?" in refused(stage, "websockets")
    wrong = ("websocket", "--option", "orgin=null")
    assert "bridge websocket has no option 'orgin'; did you mean 'origin'?" in refused(stage, *wrong)
    nobody = glovecal({"GLOVECAL_ZENOH": free_endpoint()}, "bridge", "websocket", "--to", "127.0.0.1:1")
    assert (nobody.code, "bridge websocket has no option 'to'" in nobody.said) == (1, True)


def test_gloves_are_followed_as_they_appear_and_a_slow_meta_is_waited_for(stage: Stage) -> None:
    with running_bridge(stage, "websocket", "--port", 0) as bridge, open_client([stage.endpoint]) as session:
        stage.show(right={})
        eventually(lambda: bridge.counts("right").get("state") == "live", "the first glove")
        late = WornHand(session, "late", "left")

        def is_live() -> bool:
            late.put()
            return bridge.counts("late").get("state") == "live"

        eventually(is_live, "the second glove")
        assert set(bridge.end()["gloves"]) == {"right", "late"}


def test_a_router_that_dies_is_found_again_and_poses_are_stale_meanwhile() -> None:
    endpoint = free_endpoint()
    with ExitStack() as running:
        with open_router([endpoint]), open_client([endpoint]) as session:
            hand = WornHand(session, "right", "right")
            bridge = running.enter_context(running_bridge(endpoint, "websocket", "--port", 0))
            host, port = bridge.place()
            opened = running.enter_context(connect(f"ws://{host}:{port}/"))
            eventually(lambda: moves(hand, bridge), "live")
        eventually(lambda: json.loads(opened.recv(timeout=120)).get("state") == "stale", "stale without it")
        with open_router([endpoint]), open_client([endpoint]) as session:
            hand = WornHand(session, "right", "right")
            eventually(lambda: moves(hand, bridge) and reconnects(bridge), "live again")
        assert bridge.end()["gloves"]["right"]["reconnects"] >= 1


def moves(hand: WornHand, bridge: RunningBridge) -> bool:
    hand.put()
    return bridge.counts("right").get("state") == "live"


def reconnects(bridge: RunningBridge) -> int:
    """A line that was printed before the router died says live, too."""
    return bridge.counts("right").get("reconnects", 0)
