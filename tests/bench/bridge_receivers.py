"""What stands at the other end of a live bridge in its bench, as a process of its own.

    python tests/bench/bridge_receivers.py BRIDGE HOST PORT GLOVE GLOVE

Prints ``ready`` when all is imported, ``live`` with the seconds since then when both gloves' poses have come,
and at the end of standard input what it has counted, as JSON.
"""

from __future__ import annotations

import json
import math
import struct
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np

from glovecal_client.clock import clock_ns, wall_ns

Arrival = tuple[str, float | None]
"""Glove, and seconds since the hand was so."""
PERIOD_S = 64.0


def websocket(host: str, port: int, gloves: tuple[str, ...]) -> Iterator[Arrival]:
    from websockets.sync.client import connect

    yield "", None
    with connect(f"ws://{host}:{port}/", compression=None) as opened:
        for message in opened:
            pose = json.loads(message)
            if pose["type"] == "pose" and pose["state"] == "live":
                yield pose["glove"], clock_ns() / 1e9 - pose["time_s"]


def foxglove(host: str, port: int, gloves: tuple[str, ...]) -> Iterator[Arrival]:
    from websockets.sync.client import connect
    from websockets.typing import Subprotocol

    yield "", None
    glove_of: dict[int, str] = {}
    with connect(f"ws://{host}:{port}", subprotocols=[Subprotocol("foxglove.sdk.v1")]) as opened:
        for message in opened:
            if isinstance(message, bytes):
                _, subscription, time_ns = struct.unpack_from("<BIQ", message)
                if subscription in glove_of:
                    yield glove_of[subscription], (wall_ns() - time_ns) / 1e9
                continue
            for channel in json.loads(message).get("channels", ()):
                number, topic = channel["id"], channel["topic"]
                wanted = {"op": "subscribe", "subscriptions": [{"id": number, "channelId": number}]}
                opened.send(json.dumps(wanted))
                if topic.endswith("/tf"):
                    glove_of[number] = topic.split("/")[2]


def lsl(host: str, port: int, gloves: tuple[str, ...]) -> Iterator[Arrival]:
    import pylsl

    pylsl.set_config_content("[multicast]\nResolveScope = machine\n[lab]\nKnownPeers = {127.0.0.1}\n")
    yield "", None
    inlets = {}
    for glove in gloves:
        (info, *_) = pylsl.resolve_byprop("name", f"glovecal-{glove}", timeout=60)
        inlets[glove] = pylsl.StreamInlet(info)
    while True:
        for glove, inlet in inlets.items():
            row, time_s = inlet.pull_sample(timeout=0.002)
            if row is not None and time_s is not None and row[0] == row[0]:
                yield glove, pylsl.local_clock() - time_s


def ros2(host: str, port: int, gloves: tuple[str, ...]) -> Iterator[Arrival]:
    import zenoh

    from glovecal_client.session import open_client

    arrived = zenoh.handlers.FifoChannel(1024)
    yield "", None
    with open_client([f"tcp/{host}:{port}"]) as session:
        subscriber = session.declare_subscriber("0/glovecal/**", arrived)
        for sample in subscriber:
            seconds, rest_ns = struct.unpack_from("<iI", sample.payload.to_bytes(), 4)
            yield str(sample.key_expr).split("/")[2], wall_ns() / 1e9 - seconds - rest_ns / 1e9


def vmc(host: str, port: int, gloves: tuple[str, ...]) -> Iterator[Arrival]:
    yield "", None
    bones = {b"RightIndexDistal": gloves[0], b"LeftIndexDistal": gloves[1]}
    for datagram in _datagrams(host, port):
        for bone, glove in bones.items():
            if (at := datagram.find(bone + b"\0")) >= 0:
                floats = at + len(bone) + 4 - len(bone) % 4
                yield glove, _since(struct.unpack_from(">7f", datagram, floats)[3:])


def unreal(host: str, port: int, gloves: tuple[str, ...]) -> Iterator[Arrival]:
    yield "", None
    subjects = {f"glovecal_{glove}": glove for glove in gloves}
    for datagram in _datagrams(host, port):
        for subject, rows in json.loads(datagram).items():
            (turn,) = (row["Rotation"] for row in rows if row["Name"].startswith("index_03"))
            yield subjects[subject], _since(turn)


def rokoko(host: str, port: int, gloves: tuple[str, ...]) -> Iterator[Arrival]:
    yield "", None
    for datagram in _datagrams(host, port):
        scene = json.loads(datagram)["scene"]
        yield scene["actors"][0]["glovecal"]["glove"], clock_ns() / 1e9 - scene["timestamp"]


def _datagrams(host: str, port: int) -> Iterator[bytes]:
    import socket

    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as opened:
        opened.bind((host, port))
        while True:
            yield opened.recv(65536)


def moment(time_ns: int) -> float:
    """Degrees that the last joint of the index finger is bent at that time: a degree a second, then anew, so
    that bones tell the time where a format has none."""
    return time_ns / 1e9 % PERIOD_S


def _since(xyzw: Sequence[float]) -> float:
    """Seconds since the hand was so."""
    x, y, z, w = xyzw
    degrees = 2 * math.degrees(math.atan2(math.hypot(x, y, z), abs(w)))
    return (moment(clock_ns()) - degrees + PERIOD_S / 2) % PERIOD_S - PERIOD_S / 2


KINDS: dict[str, Callable[[str, int, tuple[str, ...]], Iterator[Arrival]]] = {
    each.__name__: each for each in (websocket, foxglove, lsl, ros2, vmc, unreal, rokoko)
}


def main() -> None:
    kind, host, port, *gloves = sys.argv[1:]
    arrivals = KINDS[kind](host, int(port), tuple(gloves))
    next(arrivals)
    print("ready", flush=True)
    began = counted_from = time.monotonic()
    counts = dict.fromkeys(gloves, 0)
    last = dict.fromkeys(gloves, 0.0)
    longest_s, delays_ms = 0.0, []
    asked = threading.Event()

    def wait_for_end() -> None:
        """``from now`` begins the counting anew; the end of standard input ends it."""
        for _ in sys.stdin:
            asked.set()
        passed = time.monotonic() - counted_from
        rates_hz = [count / passed for count in counts.values()]
        document: dict[str, Any] = {"rates_hz": rates_hz, "longest_gap_ms": 1e3 * longest_s}
        document["delay_ms"] = np.percentile(delays_ms, [50, 99]).tolist() if delays_ms else None
        print(json.dumps(document), flush=True)

    threading.Thread(target=wait_for_end, daemon=True).start()
    is_live = False
    for glove, delay_s in arrivals:
        now = time.monotonic()
        if asked.is_set():
            asked.clear()
            counts.update(dict.fromkeys(gloves, 0))
            delays_ms.clear()
            longest_s, counted_from = 0.0, now
        elif last[glove]:
            longest_s = max(longest_s, now - last[glove])
        counts[glove] += 1
        last[glove] = now
        if delay_s is not None:
            delays_ms.append(1e3 * delay_s)
        if not is_live and all(last.values()):
            is_live = True
            print(f"live {now - began:.3f}", flush=True)


if __name__ == "__main__":
    main()
