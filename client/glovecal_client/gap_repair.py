"""Fetching frames that were missed on the wire from the capture daemon's log."""

from __future__ import annotations

import dataclasses
import struct

import zenoh

from glovecal_client.errors import NoAnswer, WireError
from glovecal_client.keys import GloveKeys
from glovecal_client.session import ask
from glovecal_client.wire.frame import MAX_FRAME_BYTES, Frame, FrameFlag, decode_frame

_LENGTH = struct.Struct("<I")


def fetch_frames(
    session: zenoh.Session,
    site: str,
    glove: str,
    run_id: int,
    first: int,
    last: int,
    *,
    timeout_s: float = 5.0,
) -> list[Frame]:
    """Frames ``first`` to ``last`` of a run, both included, in order, flagged as repaired.

    Frames that the log does not have are left out: compare the sequence numbers. Raises NoAnswer if nobody
    answers, the run is unknown or none of the frames is in the log; WireError if the answer is damaged.
    ``timeout_s`` bounds each of the queries; one is made per 4096 frames.
    """
    if not 0 <= first <= last:
        raise NoAnswer(f"frames {first} to {last} were asked for: nothing to fetch")
    keys = GloveKeys(site, glove)
    found: list[Frame] = []
    while first <= last:
        block = fetch_block(session, keys, run_id, first, last, timeout_s=timeout_s)
        if not block:
            break
        found += block
        first = block[-1].sequence + 1
    if not found:
        raise NoAnswer(f"{keys.log}: run {run_id:016x} has no frames {first} to {last} in its log")
    return found


def fetch_block(
    session: zenoh.Session, keys: GloveKeys, run_id: int, first: int, last: int, *, timeout_s: float = 5.0
) -> list[Frame]:
    """As many of the frames as one reply holds, in order, flagged as repaired; of several replies the first.

    Empty: the log has none of them. Raises NoAnswer if nobody answers, QueryRefused if the log cannot be read
    or is not there, WireError if the answer is damaged.
    """
    selector = f"{keys.log}?run={run_id:016x};from={first};to={last}"
    reply = ask(session, selector, timeout_s=timeout_s)[0]
    frames = split_frames(reply.payload.to_bytes())
    before = first - 1
    for frame in frames:
        if frame.run_id != run_id or not before < frame.sequence <= last:
            raise WireError(
                f"{selector}: the answer holds frame {frame.sequence} of run {frame.run_id:016x} out of place"
            )
        before = frame.sequence
    return frames


def split_frames(block: bytes) -> list[Frame]:
    """The frames of a log reply, each u32 length and frame, flagged as repaired. Raises WireError."""
    frames: list[Frame] = []
    at = 0
    while at < len(block):
        if len(block) - at < _LENGTH.size:
            raise WireError(f"log reply: {len(block) - at} bytes left over at its end")
        (length,) = _LENGTH.unpack_from(block, at)
        at += _LENGTH.size
        if length > min(MAX_FRAME_BYTES, len(block) - at):
            raise WireError(f"log reply: states a frame of {length} bytes where {len(block) - at} are left")
        frame = decode_frame(block[at : at + length])
        frames.append(dataclasses.replace(frame, flags=frame.flags | FrameFlag.REPAIRED))
        at += length
    return frames
