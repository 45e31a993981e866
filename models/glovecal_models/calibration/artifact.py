"""A calibration model as bytes: safetensors for the arrays, a JSON manifest in its header.

The artifact is named by the sha256 of its bytes, so a changed byte is a changed name: whoever loads it
checks the name first (``load`` does when it is given one). Nothing is unpickled.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from importlib.metadata import version
from typing import Any

import numpy as np
import safetensors
import safetensors.numpy

from glovecal_models.calibration.added_effect import AddedEffect
from glovecal_models.calibration.model import CalibrationModel, RotationModel, restore_regressor
from glovecal_models.calibration.servable import LARGEST_DEG, check_servable
from glovecal_models.calibration.unseen_wearing import UnseenWearing
from glovecal_models.documents import read_json
from glovecal_models.errors import BadInput, DamagedArtifact
from glovecal_models.layout import MOST_NAMES, Layout
from glovecal_models.regression.kernel_scores import choice_of

FORMAT = "glovecal.model.v1"
LARGEST_HEADER_BYTES = 8 << 20
LARGEST_NUMBER = 1e15
"""Of an array. Chosen: far inside what float32, in which poses travel, holds."""
MOST_EFFECTS, MOST_TAKES, MOST_STORED_SAMPLES = 1000, 100_000, 10_000_000


def model_id(artifact: bytes) -> str:
    """The name of a model: sha256 of its artifact, 64 hexadecimal digits."""
    return hashlib.sha256(artifact).hexdigest()


def dump(model: CalibrationModel) -> bytes:
    """The model as bytes. The same model always gives the same bytes.

    Raises BadInput for a model that does not predict: what is kept can be served.
    """
    check_servable(model)
    tensors: dict[str, np.ndarray] = {}
    rotations = []
    for item in model.rotations:
        for name, array in item.regressor.arrays().items():
            tensors[f"{item.rotation}.{name}"] = np.ascontiguousarray(array, dtype=np.float64)
        tensors[f"{item.rotation}:input_low"] = np.ascontiguousarray(item.input_low, dtype=np.float64)
        tensors[f"{item.rotation}:input_high"] = np.ascontiguousarray(item.input_high, dtype=np.float64)
        rotations.append(
            {
                "rotation": item.rotation,
                "correspondence": _correspondence_document(item),
                "regressor": item.regressor.settings(),
                "uncertain_above_deg": item.uncertain_above_deg,
                "held_out_rmse_deg": item.held_out_rmse_deg,
                "samples": item.samples,
            }
        )
    for number, added in enumerate(model.effects):
        tensors[f"effect{number}:shape"] = np.ascontiguousarray(added.shape, dtype=np.float64)
        tensors[f"effect{number}:weights"] = np.ascontiguousarray(added.weights, dtype=np.float64)
        tensors[f"effect{number}:zero_deg"] = np.ascontiguousarray(added.zero_deg, dtype=np.float64)
        if added.covariance is not None:
            tensors[f"effect{number}:covariance"] = np.ascontiguousarray(added.covariance, dtype=np.float64)
    if model.sensor_centre is not None and model.sensor_scale is not None:
        tensors["sensors:centre"] = np.ascontiguousarray(model.sensor_centre, dtype=np.float64)
        tensors["sensors:scale"] = np.ascontiguousarray(model.sensor_scale, dtype=np.float64)
    manifest = {
        "format": FORMAT,
        "software": f"glovecal-models {version('glovecal-models')}",
        "layout": model.layout.to_document(),
        "subject": model.subject,
        "method": model.method,
        "takes": list(model.takes),
        "parent": model.parent,
        "error_estimate": dict(model.error_estimate),
        "simulated": model.simulated,
        "rotations": rotations,
    }
    if model.effects:
        manifest["effects"] = [
            {
                "name": added.name,
                "rotations": list(added.rotations),
                "settings": added.settings,
                "evidence": dict(added.evidence),
            }
            for added in model.effects
        ]
    if model.unseen_wearing is not None:
        manifest["unseen_wearing"] = model.unseen_wearing.to_document()
    text = json.dumps(manifest, sort_keys=True, allow_nan=False)
    return safetensors.numpy.save(tensors, metadata={"manifest": text})


def load(artifact: bytes, *, expected_id: str | None = None) -> CalibrationModel:
    """Inverse of ``dump``. Raises DamagedArtifact when the bytes are not what ``expected_id`` names."""
    name = (expected_id or model_id(artifact))[:12]
    if expected_id is not None and model_id(artifact) != expected_id:
        raise DamagedArtifact(
            f"model {name}: its bytes hash to {model_id(artifact)[:12]}; the file was changed"
        )
    manifest = read_manifest(artifact)
    try:
        tensors = safetensors.numpy.load(artifact)
        return _restore(manifest, tensors, name)
    except BadInput as error:
        raise DamagedArtifact(f"model {name}: cannot be restored: {error}") from error
    except (KeyError, TypeError, ValueError, AttributeError, safetensors.SafetensorError) as error:
        raise DamagedArtifact(
            f"model {name}: cannot be restored: something in it is missing, or is not what it should be; "
            "export it again"
        ) from error


def read_manifest(artifact: bytes) -> dict[str, Any]:
    """The JSON manifest alone. Raises DamagedArtifact."""
    length = int.from_bytes(artifact[:8], "little")
    if len(artifact) < 8 or not 0 < length <= min(LARGEST_HEADER_BYTES, len(artifact) - 8):
        raise DamagedArtifact(
            f"not a model artifact: header of {length} bytes in a file of {len(artifact)}; send what "
            "models/ID/export gave"
        )
    try:
        header = read_json(artifact[8 : 8 + length], "its header")
        manifest = read_json(header["__metadata__"]["manifest"], "its manifest")
    except (BadInput, KeyError, TypeError, AttributeError) as error:
        raise DamagedArtifact(
            "not a model artifact: its header holds no manifest; send what models/ID/export gave"
        ) from error
    if not isinstance(manifest, dict) or manifest.get("format") != FORMAT:
        raise DamagedArtifact(f"not a {FORMAT} artifact; send what models/ID/export gave")
    return manifest


def _restore(manifest: Mapping[str, Any], tensors: Mapping[str, np.ndarray], name: str) -> CalibrationModel:
    for key, array in tensors.items():
        if array.dtype != np.float64 or not (np.abs(array) <= LARGEST_NUMBER).all():  # NaN too
            raise DamagedArtifact(
                f"model {name}: array {key[:80]!r} must be finite float64, at most {LARGEST_NUMBER:g}"
            )
    for what, most in (("rotations", MOST_NAMES), ("effects", MOST_EFFECTS), ("takes", MOST_TAKES)):
        if len(manifest.get(what, ())) > most:
            raise DamagedArtifact(
                f"model {name}: {len(manifest[what])} {what} are too many; a model has at most {most}"
            )
    by_rotation: dict[str, dict[str, np.ndarray]] = {}
    for key, array in tensors.items():
        rotation, dot, rest = key.partition(".")
        if dot:
            by_rotation.setdefault(rotation, {})[rest] = array
    return CalibrationModel(
        layout=Layout.from_document(manifest["layout"]),
        subject=str(manifest["subject"]),
        method=str(manifest["method"]),
        rotations=tuple(
            _restore_rotation(item, by_rotation.get(str(item["rotation"]), {}), tensors)
            for item in manifest["rotations"]
        ),
        effects=tuple(
            _restore_effect(number, item, tensors) for number, item in enumerate(manifest.get("effects", []))
        ),
        sensor_centre=tensors.get("sensors:centre"),
        sensor_scale=tensors.get("sensors:scale"),
        unseen_wearing=UnseenWearing.from_document(manifest.get("unseen_wearing")),
        takes=tuple(str(item) for item in manifest["takes"]),
        parent=manifest["parent"],
        error_estimate=_error_estimate(manifest["error_estimate"]),
        simulated=bool(manifest["simulated"]),
    )


def _restore_rotation(
    item: Mapping[str, Any], own: dict[str, np.ndarray], tensors: Mapping[str, np.ndarray]
) -> RotationModel:
    rotation = str(item["rotation"])
    held_out = item["held_out_rmse_deg"]
    regressor = restore_regressor(own, item["regressor"])
    choice_of(regressor)  # what is told of the choice must be of this process
    return RotationModel(
        correspondence=Layout.from_document(item["correspondence"]).correspondences[0],
        regressor=regressor,
        input_low=tensors[f"{rotation}:input_low"],
        input_high=tensors[f"{rotation}:input_high"],
        uncertain_above_deg=_within(
            item["uncertain_above_deg"], LARGEST_DEG, f"{rotation}: uncertain_above_deg"
        ),
        held_out_rmse_deg=None
        if held_out is None
        else _within(held_out, LARGEST_DEG, f"{rotation}: held_out_rmse_deg"),
        samples=int(_within(item["samples"], MOST_STORED_SAMPLES, f"{rotation}: samples")),
    )


def _error_estimate(document: Mapping[str, Any]) -> Mapping[str, Any]:
    """Its errors are degrees."""
    for name, value in document.items():
        if name.endswith("rmse_deg") and value is not None:
            _within(value, LARGEST_DEG, f"error_estimate: {name}")
    return document


def _within(value: Any, largest: float, what: str) -> float:
    """A number from 0 on. Raises BadInput for any other, and for what is no number."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not 0 <= value <= largest:
        raise BadInput(f"{what} is {repr(value)[:40]}; it lies between 0 and {largest:g}")
    return float(value)


def _restore_effect(number: int, item: Mapping[str, Any], tensors: Mapping[str, np.ndarray]) -> AddedEffect:
    return AddedEffect(
        name=str(item["name"]),
        rotations=tuple(str(name) for name in item["rotations"]),
        settings=dict(item["settings"]),
        shape=tensors[f"effect{number}:shape"],
        weights=tensors[f"effect{number}:weights"],
        zero_deg=tensors[f"effect{number}:zero_deg"],
        evidence=dict(item["evidence"]),
        covariance=tensors.get(f"effect{number}:covariance"),
    )


def _correspondence_document(item: RotationModel) -> dict[str, Any]:
    return Layout(item.rotation, item.correspondence.sensors, (item.correspondence,)).to_document()
