"""TRC (Track Row Column, Motion Analysis): markers over time, as OpenSim and MotionBuilder read them.

Readers count cells: lines end with a tab and a line feed, a missing marker is three empty cells. Angles and
readings stand where a marker's millimetres would (Krnoul et al. 2016, section 3.2).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from glovecal_models.errors import BadInput
from glovecal_service.exports.export_format import ExportFormat
from glovecal_service.exports.hand_motion import Content, HandMotion, blocks
from glovecal_service.exports.markers import markers

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


FORMAT = ExportFormat(".trc", "text/tab-separated-values", write_trc)
