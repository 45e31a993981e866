"""Tables over time: a hand as named triples of numbers (TRC), and calibrated motion (CSV and Parquet).

Places of joints are triples by nature. Angles and readings are grouped as Krnoul et al. 2016 (Figure 1) do:
for each finger abduction, metacarpal and proximal flexion as X, Y and Z; in TRC (Track Row Column, Motion
Analysis; OpenSim and MotionBuilder read it) they stand where a marker's millimetres would (section 3.2). Its
readers count cells: lines end with a tab and a line feed, a missing marker is three empty cells.

In CSV and Parquet predicted angles are named ``p.``, not ``r.`` as a take's measured ones are: they are no
reference.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from glovecal_models.errors import BadInput
from glovecal_models.hand.forward_kinematics import forward_kinematics
from glovecal_models.hand.rotations import FINGERS, WRIST, completed
from glovecal_models.takes.write_table import SIMULATED_CONTEXT, write_columns
from glovecal_service.exports.hand_motion import (
    ALL_CHANNELS,
    CONTENTS,
    NO_ROOM,
    Content,
    ExportFormat,
    HandMotion,
    blocks,
)

HAND_AXES = "of the forearm: x to the fingers, y to the right hand's thumb, z out of the back of the hand"
TRIPLES: dict[str, tuple[str, ...]] = {
    "thumb": ("TI_ABD", "T_MCP", "T_IP"),
    "thumb_roll": ("T_TMC",),
    "index": ("IM_ABD", "I_MCP", "I_PIP"),
    "index_distal": ("I_DIP",),
    "middle": ("", "M_MCP", "M_PIP"),
    "middle_distal": ("M_DIP",),
    "ring": ("MR_ABD", "R_MCP", "R_PIP"),
    "ring_distal": ("R_DIP",),
    "pinky": ("RP_ABD", "P_MCP", "P_PIP"),
    "pinky_distal": ("P_DIP",),
    "palm": ("PALM_ARCH",),
    "wrist": ("W_FLEX", "W_ABD"),
}
"""Channels of each marker, X first; another channel has a marker of its own name."""
PLACES = {
    "wrist": "W_FLEX",
    "pinky_cmc": "P_CMC",
    "thumb_cmc": "T_TMC",
    "thumb_mcp": "T_MCP",
    "thumb_ip": "T_IP",
    **{
        f"{name}_{joint.lower()}": f"{letter}_{joint}"
        for letter, name in FINGERS.items()
        if letter != "T"
        for joint in ("MCP", "PIP", "DIP")
    },
}
"""Where joints are, those that the hand has; flexion and abduction of a knuckle are one marker."""


def markers(motion: HandMotion, content: Content) -> dict[str, np.ndarray]:
    """(N, 3) by name; NaN where something is missing. Raises BadInput where nothing is calibrated."""
    if content == "raw":
        return _grouped(motion, motion.sensors, motion.readings)
    motion.require_angles(content)
    if content == "angles":
        return _grouped(motion, motion.rotations, motion.degrees)
    degrees = motion.degrees
    if motion.wrist == "optical":
        is_wrist = [name in WRIST for name in motion.rotations]
        degrees = np.where(is_wrist, 0.0, degrees)
    angles = completed(motion.rotations, degrees, motion.skeleton.rotations)
    frames = forward_kinematics(motion.skeleton, angles)
    names = [joint.name for joint in motion.skeleton.joints]
    found = {
        name: frames.joints_mm[:, names.index(joint)] for name, joint in PLACES.items() if joint in names
    }
    tips = zip(motion.skeleton.tips, frames.tips_mm.swapaxes(0, 1), strict=True)
    found |= {f"{FINGERS[tip.finger]}_tip": place for tip, place in tips}
    if motion.frame is not None:
        found = {name: motion.frame.placed(place) for name, place in found.items()}
    unknown = np.isnan(motion.degrees).all(axis=1, keepdims=True)
    hand = {f"{motion.label}_{name}": np.where(unknown, np.nan, at) for name, at in found.items()}
    return hand | dict(motion.beside)


def _grouped(motion: HandMotion, names: Sequence[str], values: np.ndarray) -> dict[str, np.ndarray]:
    channels: Mapping[str, np.ndarray] = dict(zip(names, values.T, strict=True))
    groups = {name: own for name, own in TRIPLES.items() if any(channel in channels for channel in own)}
    grouped = {channel for own in groups.values() for channel in own}
    groups |= {name: (name,) for name in names if name not in grouped}
    nothing = np.zeros(len(motion.time_s))
    triples = {}
    for name, own in groups.items():
        triple = [channels.get(channel, nothing) for channel in (*own, "", "")[:3]]
        columns = np.column_stack(triple)
        missing = np.isnan(columns).any(axis=1, keepdims=True)
        triples[f"{motion.label}_{name}"] = np.where(missing, np.nan, columns)
    return triples


KEYS = (
    "DataRate", "CameraRate", "NumFrames", "NumMarkers", "Units", "OrigDataRate", "OrigDataStartFrame",
    "OrigNumFrames",
)  # fmt: skip


def write_trc(motions: Sequence[HandMotion], content: Content, path: Path) -> None:
    """Hands on one time, one after another. Raises BadInput."""
    simulated = any(motion.simulated for motion in motions)
    title = f"{path.name} (simulated)" if simulated else path.name
    time_s = motions[0].time_s
    with path.open("w", encoding="utf-8", newline="\n") as stream:
        for which in blocks(len(time_s)):
            found: dict[str, np.ndarray] = {}
            for motion in motions:
                found |= markers(motion.frames(which), content)
            if which.start == 0:
                stream.write(_head(time_s, list(found), title))
            stream.writelines(_rows(time_s[which] - time_s[0], found, which.start + 1))


def trc_text(time_s: np.ndarray, found: Mapping[str, np.ndarray], name: str) -> str:
    """``found``: (N, 3) by marker; time is told from the first frame on. Raises BadInput without frames."""
    return _head(time_s, list(found), name) + "".join(_rows(time_s - time_s[0], found, 1))


def _head(time_s: np.ndarray, names: Sequence[str], title: str) -> str:
    if not len(time_s):
        raise BadInput("there is no frame to write")
    steps = np.diff(time_s)
    rate = f"{1 / np.median(steps):.10g}" if len(steps) else "1"
    count = len(time_s)
    values = (rate, rate, count, len(names), "mm", rate, 1, count)
    numbers = range(1, len(names) + 1)
    lines = [
        f"PathFileType\t4\t(X/Y/Z)\t{title}",
        "\t".join(KEYS),
        "\t".join(map(str, values)),
        "Frame#\tTime\t" + "".join(f"{marker}\t\t\t" for marker in names),
        "\t\t" + "".join(f"X{number}\tY{number}\tZ{number}\t" for number in numbers),
        "",
    ]
    return "\n".join(lines) + "\n"


def _rows(time_s: np.ndarray, found: Mapping[str, np.ndarray], first: int) -> Iterator[str]:
    """Lines of the frames from number ``first`` on."""
    places = np.concatenate(list(found.values()), axis=1) if found else np.empty((len(time_s), 0))
    for number, (time, row) in enumerate(zip(time_s.tolist(), places.tolist(), strict=True), first):
        cells = "".join("\t" if value != value else f"{value:.16g}\t" for value in row)
        yield f"{number}\t{time:.9f}\t{cells}\n"


TRC = ExportFormat(
    ".trc", "text/tab-separated-values", write_trc, CONTENTS, "TRC",
    unit="mm", axes=HAND_AXES, times="the frames' own", accuracy=NO_ROOM, read_by="OpenSim, MotionBuilder",
)  # fmt: skip


def write_table(motions: Sequence[HandMotion], content: Content, path: Path) -> None:
    """``p.`` (predicted) or ``r.`` (measured), ``sd.`` in degrees and ``flags.``; ``j.JOINT.x`` in mm; or raw
    ``s.``; of two hands each with its label."""
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
    prefix = "r" if motion.measured else "p"
    columns: dict[str, np.ndarray] = {}
    for number, name in enumerate(motion.rotations):
        columns[f"{prefix}.{name}"] = motion.degrees[:, number]
        columns |= {f"{channel.name}.{name}": channel.values[:, number] for channel in motion.channels}
    return columns


CSV, PARQUET = (
    ExportFormat(
        suffix, media_type, write_table, CONTENTS, name,
        unit="mm, degrees", axes=HAND_AXES, times="the frames' own",
        accuracy=ALL_CHANNELS, read_by=read_by,
    )
    for suffix, media_type, name, read_by in (
        (".csv", "text/csv", "CSV", "spreadsheets, pandas, R, MATLAB"),
        (".parquet", "application/vnd.apache.parquet", "Parquet", "pandas, Polars, DuckDB, Spark"),
    )
)  # fmt: skip
