"""Tables of calibrated motion, CSV and Parquet: a row a frame.

Predicted angles are named ``p.``, not ``r.`` as a take's measured ones are: they are no reference.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from glovecal_models.takes.write_table import SIMULATED_CONTEXT, write_columns
from glovecal_service.exports.export_format import ExportFormat
from glovecal_service.exports.hand_motion import Content, HandMotion, blocks
from glovecal_service.exports.markers import markers


def write_table(motions: Sequence[HandMotion], content: Content, path: Path) -> None:
    """``p.`` and ``sd.`` in degrees, ``j.JOINT.x`` in mm, or raw ``s.``; of two hands each with its label."""
    write_columns(_blocks(motions, content), path)


def _blocks(motions: Sequence[HandMotion], content: Content) -> Iterator[dict[str, np.ndarray]]:
    time_s = motions[0].time_s
    for which in blocks(len(time_s)):
        columns: dict[str, np.ndarray] = {"time_s": time_s[which] - time_s[0]}
        for motion in motions:
            hand = f"{motion.label}." if len(motions) > 1 else ""
            found = _columns(motion.frames(which), content)
            columns |= {f"{hand}{name}": values for name, values in found.items()}
        if any(motion.simulated for motion in motions):
            columns[f"c.{SIMULATED_CONTEXT}"] = np.ones(len(columns["time_s"]))
        yield columns


def _columns(motion: HandMotion, content: Content) -> dict[str, np.ndarray]:
    if content == "raw":
        return {f"s.{name}": column for name, column in zip(motion.sensors, motion.readings.T, strict=True)}
    motion.require_angles(content)
    if content == "joints":
        return {
            f"j.{name.removeprefix(f'{motion.label}_')}.{axis}": place[:, number]
            for name, place in markers(motion, content).items()
            for number, axis in enumerate("xyz")
        }
    angles = zip(motion.rotations, motion.degrees.T, motion.sd_deg.T, strict=True)
    return {
        key: values for name, mean, sd in angles for key, values in ((f"p.{name}", mean), (f"sd.{name}", sd))
    }


CSV = ExportFormat(".csv", "text/csv", write_table)
PARQUET = ExportFormat(".parquet", "application/vnd.apache.parquet", write_table)
