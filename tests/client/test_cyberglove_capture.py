"""The whole way: emulated box, driver, capture daemon, real zenoh, with the cable pulled in between."""

from __future__ import annotations

import threading
from pathlib import Path

import zenoh
from loopback import eventually, free_endpoint, heard_of
from test_cyberglove_driver import POSIX_ONLY, in_layout_order

from glovecal_client import GloveKeys, Recording, decode_frame, open_router
from glovecal_client.capture.command import run_capture
from glovecal_client.capture.daemon import CaptureSettings
from glovecal_service.emulators.cyberglove import EmulatedBox

pytestmark = POSIX_ONLY
KEYS = GloveKeys("lab", "right-hand")


def test_a_cyberglove_is_captured_and_comes_back_after_its_cable_was_pulled(emulate, tmp_path: Path) -> None:
    emulator = emulate(EmulatedBox(22))
    endpoint, frames, stop, outcome = free_endpoint(), [], threading.Event(), []

    def hear(sample: zenoh.Sample) -> None:
        frames.append(decode_frame(sample.payload.to_bytes()))

    def capture() -> None:
        outcome.append(
            run_capture(
                f"cyberglove:{emulator.path}",
                CaptureSettings(KEYS, endpoints=(endpoint,), data=tmp_path / "data"),
                stop=stop,
            )
        )

    with open_router([endpoint]) as router:
        subscriber = router.declare_subscriber(KEYS.raw, hear)
        daemon = threading.Thread(target=capture)
        daemon.start()
        try:
            eventually(lambda: len(frames) > 50, "50 frames came")
            emulator.unplug()
            before = len(frames)
            emulator.replug()
            eventually(lambda: len(frames) > before + 50, "frames came again")
        finally:
            stop.set()
            daemon.join(120)
        subscriber.undeclare()
    summary = outcome[0]
    sent = {tuple(in_layout_order(record, 22)) for record in emulator.box.records}
    assert all(tuple(frame.readings) in sent for frame in frames)
    assert all(frame.simulated for frame in frames)
    assert (summary.reconnects, summary.bad_frames, summary.duplicates) == (1, 0, 0)
    recording = Recording.open(summary.log)
    assert recording.meta["layout"] == "cyberglove22"
    kept = list(recording.frames())
    assert [frame.sequence for frame in kept] == list(range(summary.frames))
    assert [frame.monotonic_ns for frame in kept] == sorted(frame.monotonic_ns for frame in kept)
    # A busy computer's network may drop a frame that is on disk: what was heard is a part of it, in order.
    heard = [(frame.sequence, frame.monotonic_ns) for frame in frames]
    assert [(frame.sequence, frame.monotonic_ns) for frame in heard_of(kept, frames)] == heard
