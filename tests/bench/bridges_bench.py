"""Live bridges, measured: two gloves at 120 Hz through each of them to a receiver that nobody shares.

    python tests/bench/bridges_bench.py [--quick] [--smoke] [--bridge NAME ...] [--json FILE]

Real zenoh; gloves, bridge (``glovecal bridge``) and receivers are processes. The added delay is the bridge's
own figure, from a pose's arrival in its process to its departure; the delay from the hand is measured by the
receiver, by the time in the format, or where there is none by a finger that bends as the clock goes. Then one
receiver after another is killed and started again beside one that stays.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import re
import secrets
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

from bridge_receivers import moment
from bridge_support import FIST, WornHand
from realtime_support import free_endpoint

from glovecal_client.clock import clock_ns
from glovecal_client.session import open_client, open_router
from glovecal_models.worker_processes import pin_blas_to_one_thread

RATE_HZ = 120.0
RECEIVERS = Path(__file__).with_name("bridge_receivers.py")
BRIDGES = ("websocket", "lsl", "ros2", "foxglove", "vmc", "unreal", "rokoko")
ADDED_P99_MS, LIVE_AGAIN_S = 3.0, 2.0
"""What issue 34 asks for."""
_SENDS = {"ros2", "vmc", "unreal", "rokoko"}
"""Bridges that are told where to send to; the others listen."""
_BOTH_READ = {"websocket", "lsl", "ros2", "foxglove"}
"""Bridges with which two receivers can be connected at once."""


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--quick", action="store_true", help="shorter runs, fewer kills")
    parser.add_argument("--smoke", action="store_true", help="only whether it runs, with one bridge")
    parser.add_argument("--bridge", action="append", choices=BRIDGES, help="only this one; repeatable")
    parser.add_argument("--json", type=Path, help="write the figures to this file")
    options = parser.parse_args()
    pin_blas_to_one_thread()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))  # so that no process of ours stays behind
    seconds, kills = (2.0, 1) if options.smoke else (10.0, 5) if options.quick else (30.0, 20)
    names = options.bridge or (BRIDGES[:1] if options.smoke else BRIDGES)
    figures = [measure(name, seconds, kills) for name in names]
    show(figures, kills)
    if options.json:
        options.json.write_text(json.dumps({"bridges": figures, "load": os.getloadavg()[0]}, indent=1))


def measure(bridge: str, seconds: float, kills: int) -> dict[str, Any]:
    """One bridge: its steady flow for ``seconds``, then ``kills`` receivers."""
    endpoint, suffix = free_endpoint(), f"-{secrets.token_hex(3)}"
    gloves = (f"right{suffix}", f"left{suffix}")
    with ExitStack() as running:
        running.enter_context(open_router([endpoint]))
        running.enter_context(_gloves(endpoint, gloves))
        address = free_endpoint().removeprefix("tcp/")
        if bridge == "ros2":
            address = endpoint.removeprefix("tcp/")
        host, port = address.split(":")
        place = ("--to", address) if bridge in _SENDS else ("--port", port)
        place = () if bridge == "lsl" else place
        opened = running.enter_context(_Bridge.started(endpoint, bridge, place, gloves))
        names = tuple(glove.replace("-", "_") for glove in gloves) if bridge == "ros2" else gloves
        staying = running.enter_context(_Receiver.started(bridge, host, port, names))
        staying.wait_until_live()
        staying.begin()
        before = opened.line()
        time.sleep(seconds)
        after = opened.line()
        steady = None if bridge in _BOTH_READ else staying.end()
        again = []
        for _ in range(kills):
            with _Receiver.started(bridge, host, port, names) as killed:
                again.append(killed.wait_until_live())
                killed.process.kill()
        whole = staying.end() if steady is None else steady
        summary = opened.end()
    figures = {
        "bridge": bridge,
        "received_hz": whole["rates_hz"],
        "lost": sum(
            after["gloves"][glove][what] - before["gloves"][glove][what]
            for glove in gloves
            for what in ("lost", "overtaken", "left_out")
        ),
        "added_ms": summary["added_ms"],
        "finger_to_wire_ms": summary["finger_to_wire_ms"],
        "finger_to_receiver_ms": whole["delay_ms"],
        "longest_gap_ms": whole["longest_gap_ms"],
        "live_again_s": max(again),
    }
    print(json.dumps(figures), flush=True)
    return figures


def show(figures: list[dict[str, Any]], kills: int) -> None:
    """A table, then what is wanted beside what was measured."""
    print(
        "\n| bridge | poses a second, each glove | lost or left out | added, ms (p50, p99) | hand to wire, ms"
        f" | hand to receiver, ms | {kills} receivers killed: live again | longest gap of one that stays |"
    )
    print("|---|---|---|---|---|---|---|---|")
    for each in figures:
        rates = ", ".join(f"{rate:.1f}" for rate in each["received_hz"])
        wire, far = each["finger_to_wire_ms"], each["finger_to_receiver_ms"]
        print(
            f"| {each['bridge']} | {rates} | {each['lost']} | {each['added_ms']['p50']:.2f}, "
            f"{each['added_ms']['p99']:.2f} | {wire['p50']:.2f}, {wire['p99']:.2f} | "
            f"{'-' if far is None else f'{far[0]:.2f}, {far[1]:.2f}'} | {each['live_again_s']:.2f} s | "
            f"{each['longest_gap_ms']:.0f} ms |"
        )
    for each in figures:
        added, again = each["added_ms"]["p99"], each["live_again_s"]
        is_met = added <= ADDED_P99_MS and again <= LIVE_AGAIN_S
        print(
            f"  {'met   ' if is_met else 'MISSED'} {each['bridge']}: added p99 {added:.2f} ms "
            f"(<= {ADDED_P99_MS:g}), live again {again:.2f} s (<= {LIVE_AGAIN_S:g})"
        )
    print(f"load of the machine during the last minute: {os.getloadavg()[0]:.1f}")


@contextmanager
def _gloves(endpoint: str, names: tuple[str, str]) -> Iterator[None]:
    """A process that publishes both gloves' poses until the block ends."""
    spawn = multiprocessing.get_context("spawn")
    ready, ended = spawn.Event(), spawn.Event()
    process = spawn.Process(target=_publish, args=(endpoint, names, ready, ended))
    process.start()
    try:
        assert ready.wait(60)
        yield
    finally:
        ended.set()
        process.join(20)
        if process.is_alive():
            process.kill()
            process.join()


def _publish(endpoint: str, names: tuple[str, str], ready: Any, ended: Any) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with open_client([endpoint]) as session:
        hands = (WornHand(session, names[0], "right"), WornHand(session, names[1], "left"))
        ready.set()
        began, count = time.monotonic(), 0
        while not ended.is_set():
            for hand in hands:
                now_ns = clock_ns()
                hand.put({**FIST, "I_DIP": moment(now_ns)}, time_ns=now_ns)
            count += 1
            time.sleep(max(0.0, began + count / RATE_HZ - time.monotonic()))


class _Lines:
    """A process whose lines are read as they come."""

    def __init__(self, command: list[str], complaints: Any, **more: Any) -> None:
        self.process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=complaints, text=True, **more
        )
        self._lines: list[str] = []
        self._came = threading.Condition()
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            with self._came:
                self._lines.append(line)
                self._came.notify_all()

    def next_line(self, beginning: str, timeout_s: float = 60.0) -> str:
        """The next one that begins so."""
        with self._came:
            while True:
                while self._lines:
                    if (line := self._lines.pop(0)).startswith(beginning):
                        return line
                if not self._came.wait(timeout_s):
                    raise RuntimeError(f"no line {beginning!r} in {timeout_s:g} s")

    def __enter__(self) -> Any:
        return self

    def __exit__(self, *_: object) -> None:
        self.process.kill()
        self.process.wait()
        self._reader.join()
        for stream in (self.process.stdin, self.process.stdout):
            if stream is not None:
                stream.close()


class _Bridge(_Lines):
    """``glovecal bridge NAME --json``."""

    @classmethod
    def started(cls, endpoint: str, name: str, place: tuple[str, ...], gloves: tuple[str, ...]) -> _Bridge:
        command = [sys.executable, "-m", "glovecal_service.cli.command", "bridge", name, "--json", *place]
        command += [word for glove in gloves for word in ("--glove", glove)]
        opened = cls(command, subprocess.DEVNULL, env={**os.environ, "GLOVECAL_ZENOH": endpoint})
        while not all(each["sent"] or each["received"] for each in opened.line()["gloves"].values()):
            pass
        return opened

    def line(self) -> dict[str, Any]:
        """The next second's."""
        return json.loads(self.next_line("{"))

    def end(self) -> dict[str, Any]:
        self.process.send_signal(signal.SIGINT)
        return json.loads(self.next_line('{"summary"'))["summary"]


class _Receiver(_Lines):
    @classmethod
    def started(cls, bridge: str, host: str, port: str, gloves: tuple[str, ...]) -> _Receiver:
        return cls([sys.executable, str(RECEIVERS), bridge, host, port, *gloves], subprocess.DEVNULL)

    def wait_until_live(self) -> float:
        """Seconds from when it was ready to connect until both gloves' poses had come."""
        line = self.next_line("live")
        return float(re.findall(r"[\d.]+", line)[0])

    def begin(self) -> None:
        """Count from now on."""
        assert self.process.stdin is not None
        self.process.stdin.write("from now\n")
        self.process.stdin.flush()

    def end(self) -> dict[str, Any]:
        """What it has counted; it goes on no longer."""
        assert self.process.stdin is not None
        self.process.stdin.close()
        counted = json.loads(self.next_line("{"))
        self.process.kill()
        self.process.wait()
        return counted


if __name__ == "__main__":
    with tempfile.TemporaryDirectory(prefix="glovecal-bench-") as folder:
        os.environ["GLOVECAL_DATA"] = folder
        main()
