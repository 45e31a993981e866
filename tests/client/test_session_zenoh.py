"""Sessions bind what they were told to bind, wait as long as asked, and the router refuses oversized puts."""

from __future__ import annotations

import os
import re
import sys
from pathlib import Path

import pytest
from loopback import eventually, free_endpoint

from glovecal_client import BadName, NoAnswer, open_client, open_router
from glovecal_client.session import MAX_PUT_BYTES
from glovecal_client.wire.frame import MAX_FRAME_BYTES
from glovecal_client.wire.pose import MAX_POSE_BYTES


def listening_sockets() -> set[tuple[str, int]]:
    """Address (as the kernel writes it) and port of every tcp socket this process listens on."""
    mine = set()
    for link in Path("/proc/self/fd").iterdir():
        try:
            mine.add(os.readlink(link))
        except OSError:
            continue
    found = set()
    for table in ("/proc/self/net/tcp", "/proc/self/net/tcp6"):
        for line in Path(table).read_text().splitlines()[1:]:
            columns = line.split()
            if columns[3] == "0A" and f"socket:[{columns[9]}]" in mine:
                address, port = columns[1].split(":")
                found.add((address, int(port, 16)))
    return found


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_router_listens_on_its_endpoint_alone_and_a_client_nowhere() -> None:
    endpoint = free_endpoint()
    before = listening_sockets()
    with open_router([endpoint]):
        loopback = {("0100007F", int(endpoint.rsplit(":", 1)[1]))}
        assert listening_sockets() - before == loopback
        with open_client([endpoint]):
            assert listening_sockets() - before == loopback


def test_puts_over_the_limit_stop_at_the_router_and_our_messages_are_far_below_it() -> None:
    assert max(MAX_FRAME_BYTES, MAX_POSE_BYTES) < MAX_PUT_BYTES / 4
    endpoint = free_endpoint()
    heard: list[int] = []
    with open_router([endpoint]) as router, open_client([endpoint]) as client:
        subscriber = router.declare_subscriber("glovecal/lab/g1/raw", lambda s: heard.append(len(s.payload)))
        eventually(lambda: client.put("glovecal/lab/g1/raw", b"x") or heard, "a small put")
        heard.clear()
        for size in (MAX_PUT_BYTES + 1, 10_000_000):
            client.put("glovecal/lab/g1/raw", bytes(size))
        within = bytes(MAX_PUT_BYTES - 1)  # put again: a put is dropped while another is on its way
        put = "the put within the limit"
        eventually(lambda: client.put("glovecal/lab/g1/raw", within) or MAX_PUT_BYTES - 1 in heard, put)
        subscriber.undeclare()
    assert max(heard) == MAX_PUT_BYTES - 1


def test_without_a_router_a_client_gives_up_when_told() -> None:
    endpoint = free_endpoint()
    with pytest.raises(NoAnswer, match=r"is the service running"), open_client([endpoint], wait_s=0):
        pass
    with pytest.raises(NoAnswer, match=re.escape(endpoint)), open_client([endpoint], cancelled=lambda: True):
        pass


@pytest.mark.parametrize("endpoint", ["", "localhost", "127.0.0.1:7447", "tcp/"])
def test_what_is_no_endpoint_is_refused_at_once(endpoint: str) -> None:
    with pytest.raises(BadName, match=r"is not like 'tcp/127\.0\.0\.1:7447'"), open_client([endpoint]):
        pass
