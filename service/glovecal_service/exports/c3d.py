"""C3D, the file of movement laboratories: joints as points in millimetres, on even steps (extra ``c3d``).

What travels beside the angles is analogue channels, one sample a frame: ``R_sd.I_MCP`` in degrees, -1 where
not known, ``R_flags.I_MCP``. The format has no field for time code: it stands in the notes.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from glovecal_models.errors import BadInput
from glovecal_service.exports.body_motion import even_steps
from glovecal_service.exports.hand_motion import ALL_CHANNELS, Content, ExportFormat, HandMotion, at_times
from glovecal_service.exports.marker_tables import HAND_AXES, markers

MOST_FRAMES = 65_535
"""The file counts them in 16 bits."""
STEP_DIGITS = 9


def write_c3d(motions: Sequence[HandMotion], content: Content, path: Path) -> None:
    """Hands on one time. A point that is not known is marked as such. Raises BadInput."""
    time_s, step_s = even_steps(motions[0].time_s, STEP_DIGITS)
    if len(time_s) > MOST_FRAMES:
        raise BadInput(f"{len(time_s)} frames are too many for C3D; export at most {MOST_FRAMES}")
    points: dict[str, np.ndarray] = {}
    analogue: dict[str, np.ndarray] = {}
    units: list[str] = []
    for motion in (at_times(motion, time_s) for motion in motions):
        points |= markers(motion, content)
        for channel in motion.channels:
            names = [f"{motion.label}_{channel.name}.{rotation}" for rotation in motion.rotations]
            analogue |= zip(names, channel.numbers.T, strict=True)
            units += [channel.unit] * len(names)
    import ezc3d  # an extra

    made = ezc3d.c3d()
    parameters = made["parameters"]["POINT"]
    parameters["RATE"]["value"] = [1 / step_s]
    parameters["UNITS"]["value"] = ["mm"]
    parameters["LABELS"]["value"] = list(points)
    made["data"]["points"] = np.ones((4, len(points), len(time_s)))
    made["data"]["points"][:3] = np.array(list(points.values())).transpose(2, 0, 1)
    parameters = made["parameters"]["ANALOG"]
    parameters["RATE"]["value"] = [1 / step_s]
    parameters["LABELS"]["value"] = list(analogue)
    parameters["UNITS"]["value"] = units
    made["data"]["analogs"] = np.array(list(analogue.values()), float)[None]
    notes = {motion.label: dict(motion.notes) for motion in motions}
    made.add_parameter("GLOVECAL", "SIMULATED", [int(any(motion.simulated for motion in motions))])
    made.add_parameter("GLOVECAL", "NOTES", [json.dumps(notes)])
    made.write(str(path))


FORMAT = ExportFormat(
    ".c3d", "application/octet-stream", write_c3d, ("joints",), "C3D",
    unit="mm", axes=HAND_AXES, times="even steps", accuracy=ALL_CHANNELS,
    read_by="Visual3D, Nexus, OpenSim, Mokka, MATLAB", needs=("ezc3d", "ezc3d"),
)  # fmt: skip
