"""Each protocol's packets, good ones as other systems write them, and everything else."""

from __future__ import annotations

import struct
from contextlib import suppress

import pytest
from hypothesis import given
from hypothesis import strategies as st
from trigger_packets import RECORD_START, RECORD_STOP, START, STOP, natnet

from glovecal_models.errors import BadInput
from glovecal_service.recorder.triggers.formats import TRIGGERS, Endpoint
from glovecal_service.recorder.triggers.listener import senders_of
from glovecal_service.recorder.triggers.natnet import NatNet
from glovecal_service.recorder.triggers.osc import Osc, encode_message
from glovecal_service.recorder.triggers.trigger import Trigger, UnknownPacket, one_line, safe_name


def read(protocol: str, *packets: bytes):
    """What the last of the packets asks for."""
    reader = TRIGGERS[protocol].reader()
    return [reader.read(packet) for packet in packets][-1]


def trigger(protocol: str, *packets: bytes) -> Trigger:
    asked = read(protocol, *packets).trigger
    assert asked is not None
    return asked


def test_vicons_packets() -> None:
    assert trigger("vicon", START) == Trigger(
        "start", name="Walk 01", packet_id="28472", notes="slow & wide", description="second day",
        time_code="10:20:30:12", delay_s=0.033,
    )  # fmt: skip
    stop = trigger("vicon", STOP)
    assert (stop.action, stop.name, stop.packet_id, stop.result) == ("stop", "Walk 01", "28473", "SUCCESS")
    assert read("vicon", STOP).when_done == b"", "nobody is answered"


@pytest.mark.parametrize(
    "packet",
    [
        START.rstrip(b"\0"),
        START + b"\0" * 900,
        b"\xef\xbb\xbf" + START,
        START.replace(b"CaptureStart", b"capturestart").replace(b"VALUE", b"Value"),
        b"    \n" + START + b"  padding that is no XML",
        START.replace(b"<CaptureStart>", b'<CaptureStart xmlns="http://example.org/trigger">'),
    ],
    ids=["no NUL", "NULs", "byte order mark", "small letters", "padding", "a namespace"],
)
def test_the_same_packet_as_others_write_it(packet: bytes) -> None:
    found = trigger("motive", packet)
    assert (found.action, found.name, found.packet_id) == ("start", "Walk 01", "28472")


def test_a_name_that_is_not_utf_8_is_latin() -> None:
    assert trigger("vicon", START.replace(b"Walk 01", b"G\xe4nge")).name == "Gänge"


BOMB = b'<!DOCTYPE x [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;">]><CaptureStart><Name VALUE="&b;"/>'
OUTSIDE = b'<!DOCTYPE x SYSTEM "file:///etc/passwd"><CaptureStart><Name VALUE="x"/></CaptureStart>'


@pytest.mark.parametrize(
    ("packet", "why"),
    [
        (b"", "no XML"),
        (b"hello", "no XML"),
        (b"<CaptureStart><Name", "no whole XML"),
        (b"<CaptureStart><Name VALUE='x'/>", "no whole XML"),
        (b"<CapturePause/>", "no CaptureStart or CaptureStop"),
        (BOMB + b"</CaptureStart>", "declares a document type or entities"),
        (OUTSIDE, "declares a document type or entities"),
        (b"<CaptureStart>" + b"<a/>" * 5000 + b"</CaptureStart>", "a trigger has at most 16384"),
        (b"<a>" * 2000 + b"</a>" * 2000, "is no trigger for its size"),
        (b"<CaptureStart><Name VALUE='&unknown;'/></CaptureStart>", "no whole XML"),
    ],
)
def test_hostile_xml_is_refused(packet: bytes, why: str) -> None:
    with pytest.raises(UnknownPacket, match=why):
        read("vicon", packet)


@pytest.mark.parametrize("delay", ["", "nan", "-5", "inf", "1e300", "soon"])
def test_odd_delays(delay: str) -> None:
    found = trigger("vicon", START.replace(b'"33"', f'"{delay}"'.encode()))
    assert 0.0 <= found.delay_s <= 60.0


def test_natnet_commands() -> None:
    reader = NatNet()
    named = reader.read(natnet("SetRecordTakeName,Run, fast"))
    assert (named.trigger, named.when_done) == (None, struct.pack("<HHi", 3, 4, 0))
    started = reader.read(natnet("StartRecording"))
    assert started.trigger == Trigger("start", name="Run, fast")
    assert (started.when_done[-4:], started.when_refused[-4:]) == (b"\0\0\0\0", b"\x01\0\0\0")
    assert reader.read(natnet("StopRecording")).trigger == Trigger("stop", name="Run, fast")
    assert reader.read(natnet("StartRecording")).trigger == Trigger("start"), "the name was for one take"
    other = reader.read(natnet("LiveMode"))
    assert (other.trigger, other.when_done) == (None, struct.pack("<HH", 100, 0))


def test_live_link_faces_messages() -> None:
    assert trigger("osc", RECORD_START) == Trigger("start", name="Scene_4")
    stop = read("osc", RECORD_STOP)
    assert stop.trigger == Trigger("stop")
    assert stop.when_done.startswith(b"/RecordStopConfirm\0\0,sss\0\0\0\x0000:00:00.000\0\0\0\0")
    slate, take = b"/Slate\0\0,s\0\0B\0\0\0", b"/Take\0\0\0,i\0\0\0\0\0\x07"
    bare = b"/RecordStart\0\0\0\0,\0\0\0"
    assert trigger("osc", slate, take, bare) == Trigger("start", name="B_7")
    target = b"/OSCSetSendTarget\0\0\0,si\0" + b"10.9.9.9\0\0\0\0" + struct.pack(">i", 6000)
    assert read("osc", target, RECORD_START).answer_port == 6000, "never another computer's"
    bundle = b"#bundle\0" + b"\0" * 7 + b"\x01" + struct.pack(">i", len(RECORD_START)) + RECORD_START
    assert trigger("osc", bundle) == Trigger("start", name="Scene_4")


@pytest.mark.parametrize("protocol", ["vicon", "natnet", "osc"])
@pytest.mark.parametrize("name", ["Walk_12", "Größe 3", "a<b>&\"'c", "x"])
def test_what_we_send_is_read_as_it_was_meant(protocol: str, name: str) -> None:
    form = TRIGGERS[protocol]
    sent = Trigger("start", name, "77")
    found = trigger(protocol, *form.packets(sent))
    assert (found.action, found.name) == (
        "start",
        f"{name}_1" if protocol == "osc" and "_" not in name else name,
    )
    assert trigger(protocol, *form.packets(Trigger("stop", name, "78"))).action == "stop"


def test_what_we_send_is_what_others_document() -> None:
    assert TRIGGERS["natnet"].packets(Trigger("start", "Run")) == [
        natnet("SetRecordTakeName,Run"), natnet("StartRecording"),
    ]  # fmt: skip
    assert TRIGGERS["osc"].packets(Trigger("start", "Scene_4")) == [RECORD_START]
    assert TRIGGERS["osc"].packets(Trigger("stop")) == [RECORD_STOP]
    (xml,) = TRIGGERS["vicon"].packets(Trigger("stop", "Run", "5"))
    assert xml.startswith(
        b'<?xml version="1.0" encoding="UTF-8" standalone="no" ?><CaptureStop RESULT="SUCCESS">'
    )
    assert b'<Name VALUE="Run" />' in xml
    assert b'<PacketID VALUE="5" />' in xml
    assert xml.endswith(b"</CaptureStop>\0")


ALMOST = st.one_of(
    st.binary(max_size=300),
    st.builds(
        lambda at, bytes_: START[:at] + bytes_ + START[at:], st.integers(0, 400), st.binary(max_size=9)
    ),
    st.builds(lambda at, bytes_: RECORD_START[:at] + bytes_, st.integers(0, 40), st.binary(max_size=40)),
    st.builds(lambda tail: b"/RecordStart\0\0\0\0," + tail, st.binary(max_size=60)),
    st.builds(lambda length, body: struct.pack("<HH", 2, length) + body, st.integers(0, 65535), st.binary()),
    st.builds(lambda text: f'<CaptureStart><Name VALUE="{text}"/></CaptureStart>'.encode(), st.text()),
)


@pytest.mark.parametrize("protocol", ["vicon", "natnet", "osc"])
@given(packet=ALMOST)
def test_wild_bytes_are_a_trigger_or_refused(protocol: str, packet: bytes) -> None:
    found = None
    with suppress(UnknownPacket):
        found = read(protocol, packet).trigger
    if found is not None:
        assert found.name == one_line(found.name)
        assert 0 <= found.delay_s <= 60
        assert safe_name(found.name)


@given(name=st.text(max_size=300))
def test_every_name_becomes_one_that_a_file_can_have(name: str) -> None:
    safe = safe_name(name)
    assert 1 <= len(safe) <= 100
    assert not set(safe) & set('<>:"/\\|?*\0\n\r')
    assert safe == safe.strip(" .")
    assert safe_name(safe) == safe


def test_names_that_people_give() -> None:
    assert safe_name("Walk_01") == "Walk_01"
    assert safe_name("../../etc/passwd") == "_.._etc_passwd"
    assert safe_name("C:\\takes\\A") == "C__takes_A"
    assert safe_name("  \0 ") == "take"


def test_endpoints() -> None:
    assert Endpoint.of_text("vicon") == Endpoint("vicon", "127.0.0.1", 30)
    assert Endpoint.of_text("motive:2000") == Endpoint("motive", "127.0.0.1", 2000)
    assert Endpoint.of_text("osc:0.0.0.0:9000") == Endpoint("osc", "0.0.0.0", 9000)
    assert Endpoint.of_text("natnet:stage", host=None) == Endpoint("natnet", "stage", 1510)
    assert Endpoint.of_text("osc:[::1]:8000") == Endpoint("osc", "::1", 8000)
    for text, why in (
        ("vicom", "did you mean 'vicon'"), ("vicon:host:port", "must be PROTOCOL:HOST:PORT"),
        ("vicon::30", "must be"), ("vicon:70000", "must be"), ("vicon:0", "must be"),
    ):  # fmt: skip
        with pytest.raises(BadInput, match=why):
            Endpoint.of_text(text)
    with pytest.raises(BadInput, match="say where osc is to be sent"):
        Endpoint.of_text("osc:8000", host=None)
    with pytest.raises(BadInput, match="is no address or network"):
        senders_of(["stage"])


def test_osc_texts_are_padded_to_four_bytes() -> None:
    assert encode_message("/abc", "abc") == b"/abc\0\0\0\0,s\0\0abc\0"
    assert Osc().read(encode_message("/Slate", "abcd")).trigger is None
