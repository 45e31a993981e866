"""A take as one file: safetensors for the arrays, JSON in its metadata for the rest."""

from __future__ import annotations

import hashlib
import json
from typing import Any

import numpy as np
from safetensors import SafetensorError
from safetensors.numpy import load as load_arrays
from safetensors.numpy import save as save_arrays

from glovecal_models.errors import DamagedArtifact
from glovecal_models.takes.take import Take

VERSION = 1


def dump_take(take: Take) -> bytes:
    """The take as bytes; ``load_take`` gives it back, every number bit for bit."""
    arrays: dict[str, np.ndarray] = {
        "time_s": np.asarray(take.time_s, np.float64),
        "readings": np.asarray(take.readings, np.float64),
        "reference_time_s": np.asarray(take.reference_time_s, np.float64),
        "reference": np.asarray(take.reference, np.float64),
        **{f"context.{name}": np.asarray(column, np.float64) for name, column in take.context.items()},
    }
    if take.reference_sd is not None:  # absent in takes stored before: those read as they did
        arrays["reference_sd"] = np.asarray(take.reference_sd, np.float64)
    description: dict[str, Any] = {
        "version": VERSION,
        "name": take.name,
        "wearing": take.wearing,
        "sensors": list(take.sensors),
        "rotations": list(take.rotations),
        "context": list(take.context),
        "simulated": take.simulated,
        "poses": None,
        **({} if take.begins_s is None else {"begins_s": take.begins_s}),
    }
    if take.poses is not None:
        numbers = {pose: number for number, pose in enumerate(dict.fromkeys(take.poses))}
        description["poses"] = list(numbers)
        arrays["poses"] = np.array([numbers[pose] for pose in take.poses], np.int32)
    contiguous = {name: np.ascontiguousarray(array) for name, array in arrays.items()}
    return save_arrays(contiguous, {"glovecal.take": json.dumps(description)})


def load_take(content: bytes) -> Take:
    """Inverse of ``dump_take``. Raises DamagedArtifact if the bytes are no take."""
    try:
        arrays, description = load_arrays(content), _description(content)
        if description["version"] != VERSION:
            raise DamagedArtifact(
                f"take file has version {description['version']}, this software reads {VERSION}"
            )
        poses = description["poses"]
        if poses is not None:
            poses = tuple(poses[number] for number in arrays["poses"])
        return Take(
            name=description["name"],
            wearing=description["wearing"],
            sensors=tuple(description["sensors"]),
            time_s=arrays["time_s"],
            readings=arrays["readings"],
            rotations=tuple(description["rotations"]),
            reference_time_s=arrays["reference_time_s"],
            reference=arrays["reference"],
            reference_sd=arrays.get("reference_sd"),
            context={name: arrays[f"context.{name}"] for name in description["context"]},
            poses=poses,
            simulated=bool(description["simulated"]),
            begins_s=description.get("begins_s"),
        )
    except (SafetensorError, KeyError, IndexError, TypeError, ValueError) as error:
        raise DamagedArtifact("these bytes are no take file, or were damaged") from error


def frames_hash(take: Take) -> str:
    """sha256 hex of what the glove sent (sensor names, times, readings), whatever the take is called."""
    digest = hashlib.sha256(json.dumps(list(take.sensors)).encode())
    for array in (take.time_s, take.readings):
        digest.update(np.ascontiguousarray(array, np.float64).tobytes())
    return digest.hexdigest()


def _description(content: bytes) -> dict[str, Any]:
    header = json.loads(content[8 : 8 + int.from_bytes(content[:8], "little")])
    return json.loads(header["__metadata__"]["glovecal.take"])
