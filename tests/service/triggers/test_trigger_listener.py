"""The listening sockets, over real UDP: each trigger once, from those that may send, all else counted."""

from __future__ import annotations

import ipaddress
import socket
import struct
import threading
from collections.abc import Callable, Iterator
from queue import Empty

import pytest
from realtime_support import eventually
from trigger_packets import RECORD_START, START, STOP, natnet

from glovecal_models.errors import BadInput
from glovecal_service.recorder.triggers.formats import Endpoint
from glovecal_service.recorder.triggers.listener import Listener, senders_of

HERE = "127.0.0.1"
Listen = Callable[..., Listener]


@pytest.fixture
def sentences() -> list[str]:
    return []


@pytest.fixture
def listen(sentences: list[str]) -> Iterator[Listen]:
    """Called with protocols, each on a port of its own."""
    listeners: list[Listener] = []

    def begin(*protocols: str, host: str = HERE, senders: tuple[str, ...] = (), **options) -> Listener:
        endpoints = [Endpoint(protocol, host, 0) for protocol in protocols]
        listeners.append(Listener(endpoints, senders_of(senders), tell=sentences.append, **options))
        return listeners[-1]

    yield begin
    for listener in listeners:
        listener.close()


@pytest.fixture
def sender() -> Iterator[socket.socket]:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as opened:
        opened.settimeout(60)
        opened.bind((HERE, 0))
        yield opened


def test_a_trigger_that_is_sent_three_times_comes_once(listen: Listen, sender: socket.socket) -> None:
    listener = listen("vicon")
    for packet in (START, START, START, STOP, STOP):
        sender.sendto(packet, (HERE, listener.ports[0]))
    first, second = listener.arrivals.get(timeout=60), listener.arrivals.get(timeout=60)
    assert (first.trigger.action, second.trigger.action) == ("start", "stop")
    assert (first.protocol, first.sender) == ("vicon", HERE)
    assert first.monotonic_s < second.monotonic_s
    eventually(lambda: listener.counts.repeated == 3, "three repetitions are counted")
    assert listener.counts.sentence == "2 triggers, 3 repeated"


def test_a_packet_that_comes_in_on_two_ports_comes_once(listen: Listen, sender: socket.socket) -> None:
    listener = listen("vicon", "motive")
    for port in listener.ports:
        sender.sendto(START, (HERE, port))
    eventually(lambda: listener.counts.repeated == 1, "the second is a repetition")
    assert listener.arrivals.qsize() == 1


def test_unknown_packets_are_counted_and_told_once(
    listen: Listen, sender: socket.socket, sentences: list[str]
) -> None:
    listener = listen("vicon")
    for _ in range(5):
        sender.sendto(b"hello \x1b[2J", (HERE, listener.ports[0]))
    sender.sendto(b"", (HERE, listener.ports[0]))
    sender.sendto(START, (HERE, listener.ports[0]))
    listener.arrivals.get(timeout=60)
    assert listener.counts.sentence == "1 triggers, 6 unknown packets"
    assert sentences == [f"vicon: ignored a packet of {HERE}: it is no XML."]


def test_natnet_is_answered_when_it_was_carried_out(listen: Listen, sender: socket.socket) -> None:
    listener = listen("natnet")
    sender.sendto(natnet("SetRecordTakeName,Run"), (HERE, listener.ports[0]))
    assert sender.recv(100) == struct.pack("<HHi", 3, 4, 0)
    for is_done, code in ((True, 0), (False, 1)):
        sender.sendto(natnet("StartRecording"), (HERE, listener.ports[0]))
        listener.arrivals.get(timeout=60).answer(is_done)
        assert sender.recv(100) == struct.pack("<HHi", 3, 4, code)


def test_osc_is_confirmed_at_the_port_that_the_sender_named(listen: Listen, sender: socket.socket) -> None:
    listener = listen("osc")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind((HERE, 0))
        other.settimeout(60)
        target = b"/OSCSetSendTarget\0\0\0,si\0" + b"10.9.9.9\0\0\0\0"
        port = struct.pack(">i", other.getsockname()[1])
        sender.sendto(target + port, (HERE, listener.ports[0]))
        sender.sendto(RECORD_START, (HERE, listener.ports[0]))
        listener.arrivals.get(timeout=60).answer(True)
        assert other.recv(100) == b"/RecordStartConfirm\0,s\0\x0000:00:00.000\0\0\0\0"


def test_what_this_process_sent_is_no_trigger(listen: Listen, sender: socket.socket) -> None:
    own = (sender.getsockname()[1], START)
    listener = listen("vicon", is_own=lambda port, packet: (port, packet) == own)
    sender.sendto(START, (HERE, listener.ports[0]))
    eventually(lambda: listener.counts.own == 1, "it is known again")
    with pytest.raises(Empty):
        listener.arrivals.get_nowait()


def test_beyond_this_computer_only_those_named_may_send(listen: Listen, sentences: list[str]) -> None:
    with pytest.raises(BadInput, match="name who may begin and end recordings with --from"):
        listen("vicon", host="0.0.0.0")
    address = own_address()
    neighbour = str(ipaddress.ip_address(address) + 1)
    stranger = listen("vicon", host="0.0.0.0", senders=(neighbour,))
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        sender.bind((address, 0))
        for _ in range(3):
            sender.sendto(START, (address, stranger.ports[0]))
        eventually(lambda: stranger.counts.refused_senders[address] == 3, "it is refused")
        known = listen("vicon", host="0.0.0.0", senders=(f"{address}/32",))
        sender.sendto(START, (address, known.ports[0]))
        assert known.arrivals.get(timeout=60).sender == address
    assert stranger.arrivals.empty()
    assert sentences == [f"Ignored a packet of {address}: it is not in --from."]


def own_address() -> str:
    """An address of this computer that is not the loopback's."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as opened:
        try:
            opened.connect(("192.0.2.1", 9))
        except OSError:
            pytest.skip("this computer has no network but itself")
        return opened.getsockname()[0]


def test_a_port_that_is_taken_is_told(listen: Listen) -> None:
    taken = listen("vicon").ports[0]
    with pytest.raises(BadInput, match=f"cannot listen on osc:{HERE}:{taken}: Address already in use"):
        Listener([Endpoint("osc", HERE, taken)], [], tell=print)


def test_a_flood_is_dropped_and_counted(listen: Listen, sender: socket.socket) -> None:
    listener = listen("osc")
    eventually(lambda: flooded(listener, sender), "more triggers than wait")
    assert listener.arrivals.qsize() == 64
    assert "dropped: too many at once" in listener.counts.sentence


def flooded(listener: Listener, sender: socket.socket) -> bool:
    sender.sendto(RECORD_START, (HERE, listener.ports[0]))
    return listener.counts.dropped > 0


def test_its_threads_end(listen: Listen) -> None:
    listener = listen("vicon", "osc")
    names = {thread.name for thread in threading.enumerate()}
    assert {"vicon:127.0.0.1:0", "osc:127.0.0.1:0"} <= names
    listener.close()
    assert not {"vicon:127.0.0.1:0", "osc:127.0.0.1:0"} & {thread.name for thread in threading.enumerate()}
