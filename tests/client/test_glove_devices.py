"""Drivers and emulated gloves over real pseudo-terminals and sockets: values, loss, return, faults."""

from __future__ import annotations

import socket
import sys
import time
from collections import defaultdict
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from pathlib import Path

import numpy as np
import pytest
from free_ports import free_port
from glove_logs import HARDWARE_22, LAYOUT_22
from loopback import eventually
from test_cyberglove_driver import in_layout_order

from glovecal_client.capture.device import Device, Reading, ReopeningDevice, build_device
from glovecal_client.capture.stream.links import TcpPlace
from glovecal_client.errors import DeviceLost
from glovecal_models.layout import Layout
from glovecal_service.emulators.catalogue import PROTOCOLS, faults_of
from glovecal_service.emulators.cyberglove import EmulatedCyberGlove
from glovecal_service.emulators.glove import OFFSET_S, EmulatedGlove
from glovecal_service.emulators.hand import MovingHand
from glovecal_service.emulators.lines import DESCRIPTION
from glovecal_service.emulators.opencyberglove import EmulatedOpenCyberGlove
from glovecal_service.emulators.ports import Emulation, Port, TcpDialer, UdpSender
from glovecal_service.emulators.pseudo_terminal import PseudoTerminal

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="pseudo-terminals are a POSIX thing")
NEW = [name for name in PROTOCOLS if name != "cyberglove"]
EACH = pytest.mark.parametrize("name", NEW)
SEEN_WITHIN_S, BACK_WITHIN_S = 0.5, 2.0
OFF_S = (0.05, 0.5, 1.3)
"""How long a cable stays pulled, in turn: the pauses between tries have grown differently by then."""


class Pair:
    """An emulated glove at a port, and the driver for it."""

    def __init__(self, glove: EmulatedGlove, emulation: Emulation, device: Device) -> None:
        self.glove = glove
        self.emulation = emulation
        self.device = device

    def sent(self) -> list[tuple[float, ...]]:
        """What the glove sent so far, in the order of the driver's sensors."""
        records: list[tuple[int, ...]] = list(self.glove.sent)  # type: ignore[attr-defined]
        if len(self.device.sensors) != 22:
            return [tuple(record) for record in records]
        order = [HARDWARE_22.index(name) for name in LAYOUT_22]
        return [tuple(record[place] for place in order) for record in records]


@contextmanager
def pair(
    name: str,
    folder: Path,
    *faults: str,
    options: dict[str, str] | None = None,
    tcp: bool = False,
    udp: bool = False,
) -> Iterator[Pair]:
    port_number = free_port()
    address = str(folder / f"emulated-{name}")
    place: Port = PseudoTerminal(Path(address))
    if tcp or udp:
        address = f"{'tcp' if tcp else 'udp'}:127.0.0.1:{port_number}"
        place = (TcpDialer if tcp else UdpSender)("127.0.0.1", port_number)
    (folder / "line-glove.toml").write_text(DESCRIPTION)
    chosen = faults_of(name, faults, 3)
    glove = PROTOCOLS[name].make(MovingHand(1), chosen, tcp)
    text, *given = PROTOCOLS[name].device.format(port=address).split(" --option ")
    asked = dict(option.split("=", 1) for option in given) | (options or {})
    device = build_device(text.replace("line-glove.toml", str(folder / "line-glove.toml")), asked)
    with Emulation(glove, place, chosen) as emulation:
        yield Pair(glove, emulation, device)
        device.close()


def readings(device: Device, count: int, within_s: float = 20.0) -> list[Reading]:
    found: list[Reading] = []
    until = time.monotonic() + within_s
    while len(found) < count and time.monotonic() < until:
        if (reading := device.read(0.2)) is not None:
            found.append(reading)
    assert len(found) == count
    return found


def all_were_sent(found: list[Reading], sent: list[tuple[float, ...]]) -> bool:
    """Whether the readings are what was sent, in order, nothing made up."""
    waiting = iter(sent)
    return all(any(tuple(reading.readings.tolist()) == other for other in waiting) for reading in found)


def opened(device: Device) -> None:
    """Open, again while a network glove has not connected yet."""

    def tried() -> bool:
        try:
            device.open()
        except DeviceLost:
            return False
        return True

    eventually(tried, "the glove is there", 10)


@EACH
def test_what_was_sent_is_read_value_by_value(name: str, tmp_path: Path) -> None:
    begun_s = time.monotonic()
    with pair(name, tmp_path) as both:
        opened(both.device)
        found = readings(both.device, 40)
        values, sent = [tuple(reading.readings.tolist()) for reading in found], both.sent()
        # a hand that hardly moves sends the same values more than once
        assert any(values == sent[begin : begin + 40] for begin in range(len(sent) - 39))
        assert both.device.simulated
        assert both.device.counters.bad_frames == 0  # type: ignore[attr-defined]
        stamps = [reading.monotonic_ns for reading in found]
        assert np.all(np.diff(stamps) > 0)
        span_s = (stamps[-1] - stamps[0]) / 1e9
        assert 0.5 * 39 / both.device.rate_hz < span_s < time.monotonic() - begun_s


@pytest.mark.parametrize("name", [name for name in NEW if "tcp" in PROTOCOLS[name].links])
def test_a_glove_that_connects_over_tcp(name: str, tmp_path: Path) -> None:
    with pair(name, tmp_path, options={"simulated": "yes"}, tcp=True) as both:
        opened(both.device)
        assert all_were_sent(readings(both.device, 20), both.sent())
        both.emulation.unplug()
        assert lost_within(both.device) < SEEN_WITHIN_S
        both.emulation.replug()
        opened(both.device)
        assert all_were_sent(readings(both.device, 5), both.sent())


def test_a_dialer_that_has_nothing_to_read_keeps_its_connection() -> None:
    """Told too late that an earlier connection could be read, it once waited and hung up."""
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        listener.listen()
        dialer = TcpDialer("127.0.0.1", listener.getsockname()[1])
        dialer.plug()
        connection, _ = listener.accept()
        with connection:
            begun = time.monotonic()
            assert dialer.read() == b""
            assert time.monotonic() - begun < 0.5
            assert dialer.write(b"still here")
            assert connection.recv(100) == b"still here"
        dialer.unplug()


def test_a_glove_that_sends_datagrams(tmp_path: Path) -> None:
    with pair("line", tmp_path, udp=True) as both:
        assert not both.device.simulated
        opened(both.device)
        found = readings(both.device, 20)
        assert all_were_sent(found, both.sent())
        assert found[0].context == pytest.approx((7.445,), abs=1e-3)
        both.emulation.unplug()
        assert lost_within(both.device) < SEEN_WITHIN_S


def lost_within(device: Device) -> float:
    """Seconds until the driver says that the glove is gone."""
    begun = time.monotonic()
    told_why_lost(device)
    return time.monotonic() - begun


def told_why_lost(device: Device | ReopeningDevice, within_s: float = 8.0) -> str:
    """Read until the driver says that the glove is gone; its sentence."""
    until = time.monotonic() + within_s
    while time.monotonic() < until:
        try:
            device.read(0.05)
        except DeviceLost as lost:
            return str(lost)
    pytest.fail(f"not noticed in {within_s:g} s")


def plug_cycles(both: Pair, cycles: int) -> tuple[float, float]:
    """Longest times until a pulled cable was seen, and until readings were back, as capture sees them."""
    device = ReopeningDevice(both.device)
    slowest_seen = slowest_back = 0.0
    found: list[Reading] = []

    def next_reading() -> bool:
        try:
            reading = device.read(0.05)
        except DeviceLost:
            return False
        if reading is not None:
            found.append(reading)
        return reading is not None

    eventually(next_reading, "a first reading", 10)
    for number in range(cycles):
        both.emulation.unplug()
        begun = time.monotonic()
        told_why_lost(device)
        slowest_seen = max(slowest_seen, time.monotonic() - begun)
        until = time.monotonic() + OFF_S[number % len(OFF_S)]
        while time.monotonic() < until:
            next_reading()
        both.emulation.replug()
        begun = time.monotonic()
        eventually(next_reading, "readings are back", 10)
        slowest_back = max(slowest_back, time.monotonic() - begun)
    assert all_were_sent(found, both.sent())
    return slowest_seen, slowest_back


@EACH
def test_a_pulled_cable_is_seen_and_the_glove_comes_back(name: str, tmp_path: Path) -> None:
    with pair(name, tmp_path) as both:
        seen_s, back_s = plug_cycles(both, 2)
    assert seen_s < SEEN_WITHIN_S
    assert back_s < BACK_WITHIN_S


@pytest.mark.slow
@EACH
def test_a_hundred_pulled_cables(name: str, tmp_path: Path) -> None:
    with pair(name, tmp_path) as both:
        seen_s, back_s = plug_cycles(both, 100)
    print(f"{name}: seen within {seen_s:.2f} s, back within {back_s:.2f} s")
    assert seen_s < SEEN_WITHIN_S
    assert back_s < BACK_WITHIN_S


@EACH
def test_noise_and_short_records_bring_no_wrong_reading(name: str, tmp_path: Path) -> None:
    with pair(name, tmp_path, "noise", "short-records", options=seeing_no_answer(name)) as both:
        opened(both.device)
        found = readings(both.device, 60)
        assert all_were_sent(found, both.sent())
        assert both.device.counters.skipped_bytes > 0  # type: ignore[attr-defined]


def seeing_no_answer(name: str) -> dict[str, str]:
    """The battery's answer is no record, so it would not tell that damage was met."""
    return {"battery": "leave"} if name == "cyberglove3" else {}


def test_fragments_of_time_stamps_between_records_cost_no_record(tmp_path: Path) -> None:
    with pair("cyberglove3", tmp_path, "fragments") as both:
        opened(both.device)
        found = readings(both.device, 60)
        values, sent = [tuple(reading.readings.tolist()) for reading in found], both.sent()
        assert any(values == sent[begin : begin + 60] for begin in range(len(sent) - 59))


def test_a_cyberglove_with_the_simulated_hand_in_it(tmp_path: Path) -> None:
    with pair("cyberglove", tmp_path, "noise", "short-records", options={"timestamp": "on"}) as both:
        opened(both.device)
        found = readings(both.device, 60)
        box = both.glove
        assert isinstance(box, EmulatedCyberGlove)
        sent = [in_layout_order(record, 18) for record in box.records]
        assert all(one.readings.tolist() in sent for one in found)
        assert both.device.simulated
        both.emulation.unplug()
        assert lost_within(both.device) < SEEN_WITHIN_S
        both.emulation.replug()
        opened(both.device)
        assert readings(both.device, 3)


def test_a_stuck_sensor_arrives_as_it_is(tmp_path: Path) -> None:
    with pair("homunculus", tmp_path, "stuck-sensor") as both:
        opened(both.device)
        columns = np.array([reading.readings for reading in readings(both.device, 40)])
    assert np.ptp(columns[:, 1]) == 0
    assert np.ptp(columns[:, 5]) > 0


def test_dropped_echoes_and_an_empty_battery_are_told(tmp_path: Path) -> None:
    with pair("cyberglove3", tmp_path, "dropped-echo", "battery") as both:
        opened(both.device)
        readings(both.device, 5)
        notice: str = both.device.notice  # type: ignore[attr-defined]
        assert "battery 8.20 V" in notice
        assert "echo" in notice
        assert both.glove.multiplier == 3  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    ("name", "options"),
    [("opencyberglove", {"clock": "glove_us"}), ("cyberglove3", {"clock": "glove"}), ("line", {})],
)
def test_a_glove_clock_that_is_off_and_drifts_gives_times_of_now(
    name: str, options: dict[str, str], tmp_path: Path
) -> None:
    with pair(name, tmp_path, "clock-offset", "clock-drift", options=options) as both:
        opened(both.device)
        found = readings(both.device, 60)
        age_s = (time.monotonic_ns() - found[-1].monotonic_ns) / 1e9
        assert 0 <= age_s < OFFSET_S / 10  # a busy computer may take a while to read
        steps_s = np.diff([reading.monotonic_ns for reading in found]) / 1e9
        assert np.median(steps_s) == pytest.approx(1 / both.device.rate_hz, rel=0.1)


def test_a_lucidglove_that_is_not_answered_sends_a_line_a_second(tmp_path: Path) -> None:
    with pair("lucidglove", tmp_path, options={"answer": "none"}) as both:
        both.device.open()
        until = time.monotonic() + 1.4
        count = 0
        while time.monotonic() < until:
            try:
                count += both.device.read(0.1) is not None
            except DeviceLost:
                break
        assert count <= 2


def test_another_glove_on_the_port_is_told(tmp_path: Path) -> None:
    with pair("homunculus", tmp_path) as both:
        wrong = build_device(f"opencyberglove:{tmp_path}/emulated-homunculus")
        wrong.open()
        assert "not what a glove of kind opencyberglove sends" in told_why_lost(wrong)
        assert both.emulation.sendings > 0


def test_a_closed_driver_stops_the_stream_of_a_cyberglove3(tmp_path: Path) -> None:
    with pair("cyberglove3", tmp_path, options={"multiplier": "4"}) as both:
        opened(both.device)
        readings(both.device, 3)
        both.device.close()
        eventually(lambda: both.glove.commands[-1] == b"\x03", "it was told to stop", 5)  # type: ignore[attr-defined]
        assert both.glove.commands[:5] == [b"\x03", b"V", b"1eu", b"1dw", b"1m\x04"]  # type: ignore[attr-defined]
        assert both.glove.commands[5:9] == [b"1u\x01", b"1w\x01", b"1S", b"\x03"]  # type: ignore[attr-defined]


def test_a_rate_that_another_program_divided_is_whole_again(tmp_path: Path) -> None:
    with pair("cyberglove3", tmp_path) as both:
        both.glove.dividers.update(u=3, w=3)  # type: ignore[attr-defined]
        opened(both.device)
        readings(both.device, 3)
        assert both.glove.dividers == {"s": 1, "u": 1, "w": 1}  # type: ignore[attr-defined]


@pytest.mark.parametrize("asked", [0, 1])
def test_what_is_left_of_an_echo_is_no_part_of_a_file_name(asked: int, tmp_path: Path) -> None:
    with pair("cyberglove3", tmp_path, "dropped-echo") as both:
        both.glove.card["lefty.dat"] = both.glove.card["MONDAY.DAT"] = b""  # type: ignore[attr-defined]
        opened(both.device)
        readings(both.device, 3)
        for _ in range(asked):  # every second echo is damaged: another one now
            both.device.command("set-clock", "")  # type: ignore[attr-defined]
        assert both.device.command("status", "")["files"] == ["lefty.dat", "MONDAY.DAT"]  # type: ignore[attr-defined]


def test_a_bent_joint_moves_the_sensor_that_the_opencyberglove_layout_reads() -> None:
    layout = Layout.built_in("opencyberglove")
    glove = EmulatedOpenCyberGlove()
    for rotation in layout.rotations:
        glove.hand = OneJoint(rotation)  # type: ignore[assignment]
        (sensor,) = layout.correspondence(rotation).sensors
        assert layout.sensors[int(np.argmax(glove.values(0.0)))] == sensor


class OneJoint:
    """A hand of which one joint is bent."""

    def __init__(self, bent: str) -> None:
        self._bent = bent

    def bent(self, _time_s: float) -> Mapping[str, float]:
        return defaultdict(float, {self._bent: 1.0})


def test_a_glove_that_dials_in_is_not_kept_out_by_connections_that_say_nothing() -> None:
    port = free_port()
    place = TcpPlace("127.0.0.1", port)
    with ExitStack() as strangers:
        strangers.callback(place.close)
        with pytest.raises(DeviceLost, match="no glove has connected"):
            place.open()
        for _ in range(20):
            strangers.enter_context(socket.create_connection(("127.0.0.1", port)))
        with socket.create_connection(("127.0.0.1", port)) as glove:
            glove.sendall(b"A100\n")
            link = place.open()
            strangers.callback(link.close)
            assert link.read(1.0) == b"A100\n"
        silent = place.open()
        strangers.callback(silent.close)
        assert silent.read(0.0) == b"", "it may be a glove that waits to be asked"


def test_a_connection_that_was_closed_again_is_no_glove() -> None:
    port = free_port()
    place = TcpPlace("127.0.0.1", port)
    with pytest.raises(DeviceLost, match="no glove has connected"):
        place.open()
    socket.create_connection(("127.0.0.1", port)).close()
    with pytest.raises(DeviceLost, match="no glove has connected"):
        place.open()
    place.close()
