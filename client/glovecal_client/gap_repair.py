"""Frames of the capture daemon's log: those missed on the wire are fetched, those that came are compared."""

from __future__ import annotations

import dataclasses
import hashlib
import struct
from collections.abc import Iterable

import zenoh

from glovecal_client.errors import NoAnswer, WireError
from glovecal_client.keys import GloveKeys
from glovecal_client.session import ask, ask_json
from glovecal_client.wire.frame import MAX_FRAME_BYTES, Frame, FrameFlag, decode_frame, encode_frame

_LENGTH = struct.Struct("<I")
_FLAGS_AT = 5


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


@dataclasses.dataclass(frozen=True)
class BlockDigest:
    """What a log has of the frames that were asked for, as many as one reply holds."""

    frames: int
    first: int
    """Sequence number of the first of them."""
    last: int
    sha256: str
    """As ``digest_of`` makes it of the same frames."""


def fetch_digest(
    session: zenoh.Session, keys: GloveKeys, run_id: int, first: int, last: int, *, timeout_s: float = 5.0
) -> BlockDigest | None:
    """The digest of the block that ``fetch_block`` would bring; None: the log has none of these frames.

    Raises NoAnswer if nobody answers, QueryRefused if the log cannot be read or is not there, also by a
    capture of before there were digests; WireError if the answer is damaged.
    """
    selector = f"{keys.log}?run={run_id:016x};from={first};to={last};digest=sha256"
    answer = ask_json(session, selector, timeout_s=timeout_s)
    try:
        if not (frames := int(answer["frames"])):
            return None
        digest = BlockDigest(frames, int(answer["first"]), int(answer["last"]), str(answer["sha256"]))
    except (KeyError, TypeError, ValueError) as error:
        raise WireError(f"{selector}: the answer is not a digest") from error
    if not first <= digest.first <= digest.last <= last:
        raise WireError(f"{selector}: the answer is on frames {digest.first} to {digest.last}")
    return digest


def digest_of(messages: Iterable[bytes]) -> str:
    """Of frames as the log has them (``as_logged``), in order; 64 hexadecimal digits."""
    digest = hashlib.sha256()
    for message in messages:
        digest.update(_LENGTH.pack(len(message)))
        digest.update(message)
    return digest.hexdigest()


def as_logged(message: bytes) -> bytes:
    """A frame's message as it lies in its capture log: one that was fetched is flagged as repaired since."""
    if not message[_FLAGS_AT] & FrameFlag.REPAIRED:
        return message
    frame = decode_frame(message)
    return encode_frame(dataclasses.replace(frame, flags=frame.flags & ~FrameFlag.REPAIRED))
