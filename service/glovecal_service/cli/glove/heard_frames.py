"""Frames of a live glove, heard for a while."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import zenoh

    from glovecal_client.wire.frame import Frame


@contextmanager
def heard_frames(session: zenoh.Session, raw_key: str) -> Iterator[list[Frame]]:
    """A list that grows within the block; damaged messages are left out."""
    import zenoh

    from glovecal_client.errors import WireError
    from glovecal_client.wire.frame import decode_frame

    heard: list[Frame] = []

    def hear(sample: zenoh.Sample) -> None:
        try:
            heard.append(decode_frame(sample.payload.to_bytes()))
        except WireError:
            return

    subscriber = session.declare_subscriber(raw_key, zenoh.handlers.Callback(hear, indirect=True))
    try:
        yield heard
    finally:
        subscriber.undeclare()


def times_and_readings(heard: list[Frame]) -> tuple[np.ndarray, np.ndarray]:
    """Of the newest run: (N,) seconds of the capture computer's monotonic clock, increasing, and (N, S)."""
    frames = [frame for frame in heard if frame.run_id == heard[-1].run_id]
    frames.sort(key=lambda frame: frame.monotonic_ns)
    times = np.array([frame.monotonic_ns for frame in frames]) / 1e9
    later = np.diff(times, prepend=-np.inf) > 0
    return times[later], np.array([frame.readings for frame in frames], dtype=float)[later]
