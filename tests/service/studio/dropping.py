"""Files dropped on a page, as from a file manager, and some to drop."""

from __future__ import annotations

import base64
import csv
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from foreign_tables import JOINTS, recording
from playwright.sync_api import Page

from glovecal_client.rest import RestClient
from glovecal_models.hand.rotations import HAND_ROTATIONS, completed
from glovecal_models.hand.skeleton import hand_skeleton
from glovecal_service.exports.formats import FORMATS
from glovecal_service.exports.hand_motion import HandMotion

FINGERS = ("T_IP", "I_PIP", "M_PIP", "R_PIP", "P_PIP")
LATE_S = 7.3
"""Of another system that was started after the glove."""


def drop(page: Page, files: Sequence[Path]) -> None:
    """As from a file manager onto the middle of the page."""
    page.locator(".q-uploader").wait_for(state="attached")
    dropped = [{"name": file.name, "data": base64.b64encode(file.read_bytes()).decode()} for file in files]
    page.evaluate(
        """files => {
            const dropped = new DataTransfer();
            const bytes = file => Uint8Array.from(atob(file.data), c => c.charCodeAt(0));
            for (const file of files)
                dropped.items.add(new File([bytes(file)], file.name));
            document.querySelector("#main").dispatchEvent(
                new DragEvent("drop", {dataTransfer: dropped, bubbles: true, cancelable: true}));
        }""",
        dropped,
    )


def readings_table(path: Path, take: int, seconds: float) -> np.ndarray:
    """Readings of an unknown glove without angles; the angles (N, 5) of its fingers."""
    time_s, readings, angles = recording(take, 1, seconds=seconds)
    with path.open("w", encoding="utf-8", newline="") as stream:
        rows = csv.writer(stream)
        rows.writerow(["time [s]", *(f"{name} sensor" for name in JOINTS)])
        rows.writerows([f"{at:.4f}", *map(int, counts)] for at, counts in zip(time_s, readings, strict=True))
    return angles


def motion_file(path: Path, angles: np.ndarray, *, from_s: float = 0.0) -> Path:
    """What a camera system saw of that hand, from ``from_s`` on, on a clock of its own."""
    at = np.arange(len(angles)) / 60.0
    seen = at >= from_s
    degrees = completed(FINGERS, angles[seen], HAND_ROTATIONS)
    motion = HandMotion(
        "R", at[seen] - from_s, ("none",), np.zeros((int(seen.sum()), 1)), HAND_ROTATIONS, degrees,
        np.ones_like(degrees), hand_skeleton(),
    )  # fmt: skip
    FORMATS[path.suffix].write([motion], "joints", path)
    return path


def takes_without_angles(client: RestClient, person: str, folder: Path, *, first: int) -> list[np.ndarray]:
    """Imports ``person-0`` and ``person-1``; the angles (N, 5) of each, which nobody measured."""
    readings = [folder / f"{person}-{number}.csv" for number in range(2)]
    angles = [readings_table(path, first + number, 25.0) for number, path in enumerate(readings)]
    layout = {
        "name": "five-fingers",
        "sensors": list(FINGERS),
        "rotations": {name: [name] for name in FINGERS},
    }
    client.put("/gloves/five-fingers", layout)
    for path in readings:
        named = path.read_text().replace("time [s]", "time_s", 1)
        for joint, rotation in zip(JOINTS, FINGERS, strict=True):
            named = named.replace(f"{joint} sensor", f"s.{rotation}", 1)
        path.write_text(named)
        client.upload_takes(path, subject=person, layout="five-fingers", create_subject=True)
    return angles
