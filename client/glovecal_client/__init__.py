"""Glovecal on the wire: frames and poses over zenoh, capture of gloves, fetching of missed frames.

What stands here is the public interface. ``glovecal_client.capture`` holds the devices and the daemon; the
REST client is in a module of its own and needs the extra ``[rest]``.
"""

from glovecal_client.errors import (
    BadEncryptionKey,
    BadName,
    BadOption,
    CaptureRefused,
    ClientError,
    DamagedFile,
    DamagedLog,
    DeviceError,
    DeviceFinished,
    DeviceLost,
    NoAnswer,
    NotAdmitted,
    QueryRefused,
    ServiceError,
    UnknownDevice,
    WireError,
)
from glovecal_client.frame_log import FrameLog, Recording
from glovecal_client.gap_repair import fetch_frames
from glovecal_client.keys import GloveKeys, all_gloves, all_services, parse_glove_key, service_alive_key
from glovecal_client.pose_subscriber import PoseCounts, PoseSubscriber
from glovecal_client.session import DEFAULT_ENDPOINT, open_client, open_router
from glovecal_client.wire.frame import FRAME_ENCODING, Frame, FrameFlag, decode_frame, encode_frame
from glovecal_client.wire.pose import (
    POSE_ENCODING,
    Pose,
    PoseFlag,
    RotationFlag,
    decode_pose,
    encode_pose,
)

__all__ = [
    "DEFAULT_ENDPOINT",
    "FRAME_ENCODING",
    "POSE_ENCODING",
    "BadEncryptionKey",
    "BadName",
    "BadOption",
    "CaptureRefused",
    "ClientError",
    "DamagedFile",
    "DamagedLog",
    "DeviceError",
    "DeviceFinished",
    "DeviceLost",
    "Frame",
    "FrameFlag",
    "FrameLog",
    "GloveKeys",
    "NoAnswer",
    "NotAdmitted",
    "Pose",
    "PoseCounts",
    "PoseFlag",
    "PoseSubscriber",
    "QueryRefused",
    "Recording",
    "RotationFlag",
    "ServiceError",
    "UnknownDevice",
    "WireError",
    "all_gloves",
    "all_services",
    "decode_frame",
    "decode_pose",
    "encode_frame",
    "encode_pose",
    "fetch_frames",
    "open_client",
    "open_router",
    "parse_glove_key",
    "service_alive_key",
]
