"""Writes the golden messages with struct and zlib alone, from the tables in wire/README.md.

Run by hand when a new version of a message is added; the files of version 1 never change.
"""

from __future__ import annotations

import json
import math
import struct
import zlib
from pathlib import Path

HERE = Path(__file__).parent

FRAME = {
    "flags": 3,
    "sequence": 1234567,
    "monotonic_ns": 987654321012345,
    "wall_ns": 1795255800123456789,
    "run_id": 0xFEDCBA9876543210,
    "readings": [0.0, 1.0, 127.5, 255.0, -3.25, 4095.0],
    "context": [4.96875, None],
}
POSE = {
    "flags": 4 | 8 | 32,
    "sequence": 1234567,
    "monotonic_ns": 987654321012345,
    "wall_ns": 1795255800123456789,
    "run_id": 0xFEDCBA9876543210,
    "skipped": 17,
    "age_us": 412,
    "model_sha256": "".join(f"{i:02x}" for i in range(1, 33)),
    "degrees": [12.5, -7.25, 90.0],
    "deviations": [0.5, 1.125, 30.0],
    "rotation_flags": [0, 4, 3],
}

SETTLING_POSE = POSE | {"flags": 16 | 64, "skipped": 0}
FAULTY_POSE = POSE | {"flags": 8 | 128, "rotation_flags": [8, 0, 8 | 4 | 2]}


def sealed(body: bytes) -> bytes:
    return body + struct.pack("<I", zlib.crc32(body))


def frame_bytes(v: dict) -> bytes:
    context = [math.nan if value is None else value for value in v["context"]]
    head = b"GLVF" + struct.pack("<BBH", 1, v["flags"], len(v["readings"]))
    head += struct.pack("<QqqQ", v["sequence"], v["monotonic_ns"], v["wall_ns"], v["run_id"])
    head += struct.pack("<HH", len(context), 0)
    return sealed(head + b"".join(struct.pack("<f", value) for value in v["readings"] + context))


def pose_bytes(v: dict) -> bytes:
    head = b"GLVP" + struct.pack("<BBH", 1, v["flags"], len(v["degrees"]))
    head += struct.pack("<QqqQ", v["sequence"], v["monotonic_ns"], v["wall_ns"], v["run_id"])
    head += struct.pack("<QII", v["skipped"], v["age_us"], 0) + bytes.fromhex(v["model_sha256"])
    floats = b"".join(struct.pack("<f", value) for value in v["degrees"] + v["deviations"])
    return sealed(head + floats + bytes(v["rotation_flags"]))


def main() -> None:
    for name, values, message in (
        ("frame_v1", FRAME, frame_bytes(FRAME)),
        ("pose_v1", POSE, pose_bytes(POSE)),
        ("pose_v1_settling", SETTLING_POSE, pose_bytes(SETTLING_POSE)),
        ("pose_v1_faulty", FAULTY_POSE, pose_bytes(FAULTY_POSE)),
    ):
        (HERE / f"{name}.bin").write_bytes(message)
        (HERE / f"{name}.json").write_text(json.dumps(values, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
