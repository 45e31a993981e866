"""Recordings of a glove that nobody here knows, as three people wrote them down, with a hidden effect.

Readings follow formulas of their own: a bent strip's saturating curve, a share of the neighbour's bend, and a
play of some degrees between joint and strip (backlash), that a linear model cannot follow.
"""

from __future__ import annotations

import csv
from collections.abc import Callable, Sequence
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np

JOINTS = ("Thumb IP", "Index PIP", "Middle PIP", "Ring PIP", "Pinky PIP")
ROTATIONS = ("T_IP", "I_PIP", "M_PIP", "R_PIP", "P_PIP")
PLAY_DEG = 14.0
BEGAN = datetime(2026, 3, 2, 9, 30, tzinfo=UTC)


def motion(rng: np.random.Generator, time_s: np.ndarray) -> np.ndarray:
    """(N, 5) degrees: fingers that open and close, together and each for itself."""
    beats = rng.uniform(0.15, 0.8, (3, 5))
    phases = rng.uniform(0, 2 * np.pi, (3, 5))
    swing = np.array([0.5, 0.3, 0.2])[:, None, None] * np.sin(
        2 * np.pi * beats[:, None, :] * time_s[None, :, None] + phases[:, None, :]
    )
    return 45.0 + 42.0 * swing.sum(axis=0)


def with_play(angles: np.ndarray, play_deg: float) -> np.ndarray:
    """The strip follows the joint only when the play between them is used up."""
    followed = angles.copy()
    for at in range(1, len(angles)):
        low, high = angles[at] - play_deg / 2, angles[at] + play_deg / 2
        followed[at] = np.clip(followed[at - 1], low, high)
    return followed


def recording(
    take: int, wearing: int, *, play_deg: float = PLAY_DEG, seconds: float = 30.0, rate_hz: float = 60.0
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Seconds (N,), readings (N, 5) in counts of 12 bits, angles (N, 5) in degrees."""
    rng = np.random.default_rng([take, wearing])
    time_s = np.arange(int(seconds * rate_hz)) / rate_hz
    angles = motion(rng, time_s)
    felt = angles.copy()
    felt[:, 1] = with_play(angles[:, 1], play_deg)
    felt[:, 2] = with_play(angles[:, 2], play_deg)
    felt = felt + 0.08 * np.roll(felt, 1, axis=1)
    moved = np.random.default_rng(1000 + wearing).normal(0.0, 1.0, 5)
    counts = 900.0 + 2400.0 * (1.0 - np.exp(-(felt + moved) / 95.0)) + rng.normal(0.0, 7.0, felt.shape)
    return time_s, np.clip(np.round(counts), 0, 4095), angles


def takes(count: int, **more: float) -> list[tuple[str, str, np.ndarray, np.ndarray, np.ndarray]]:
    """Take, wearing, seconds, readings and angles; four takes a wearing."""
    return [
        (f"t{take}", f"w{1 + take // 4}", *recording(take, 1 + take // 4, **more)) for take in range(count)
    ]


def semicolons(folder: Path, count: int = 12, **more: float) -> list[Path]:
    """One file as a German spreadsheet writes it: milliseconds, decimal commas, two lines above."""
    path = folder / "Messung Handschuh.csv"
    heads = [f"{name} Sensor [counts]" for name in JOINTS] + [f"{name} Winkel [°]" for name in JOINTS]
    with path.open("w", encoding="cp1252", newline="") as stream:
        stream.write("Handschuh;Prototyp 4\r\nErstellt;02.03.2026\r\n")
        stream.write(";".join(["Zeit [ms]", "Trial", "Session", *heads, ""]) + "\r\n")
        for name, wearing, time_s, readings, angles in takes(count, **more):
            for at, counts, degrees in zip(time_s, readings, angles, strict=True):
                cells = [f"{1e3 * at:.1f}", name, wearing, *(f"{each:.0f}" for each in counts)]
                cells += [f"{each:.2f}" for each in degrees]
                stream.write(";".join(cells).replace(".", ",") + ";\r\n")
    return [path]


def logger(folder: Path, count: int = 12, **more: float) -> list[Path]:
    """One file a take as a microcontroller's logger writes it: microseconds, pins, angles in radians."""
    files = []
    for name, wearing, time_s, readings, angles in takes(count, **more):
        path = folder / f"log_{wearing}_{name}.txt"
        with path.open("w", encoding="utf-8") as stream:
            stream.write("# flexglove 0.3\n")
            stream.write(
                " ".join(["micros", *(f"A{at}" for at in range(5)), *(f"joint{at}" for at in range(5))])
                + "\n"
            )
            for at, counts, degrees in zip(time_s, readings, angles, strict=True):
                cells = [f"{1e6 * at + 4e6:.0f}", *(f"{each:.0f}" for each in counts)]
                stream.write(" ".join([*cells, *(f"{each:.5f}" for each in np.radians(degrees))]) + "\n")
        files.append(path)
    return files


def laboratory(folder: Path, count: int = 12, **more: float) -> list[Path]:
    """One file as an optical laboratory merges it: dates, a row counter, volts, angles on every other row."""
    path = folder / "subject07_merged.csv"
    began = BEGAN
    with path.open("w", encoding="utf-8", newline="") as stream:
        writer = csv.writer(stream)
        words = [name.lower().replace(" ", "_") for name in JOINTS]
        writer.writerow(["Frame", "Timestamp", "Placement", *(f"flex_{each}_V" for each in words),
                         *(f"opti_{each}_deg" for each in words), "Temperature (C)"])  # fmt: skip
        writer.writerow(["#", "", "", *["V"] * 5, *["deg"] * 5, "C"])
        frame = 0
        for _, wearing, time_s, readings, angles in takes(count, **more):
            for at, counts, degrees in zip(time_s, readings, angles, strict=True):
                moment = (began + timedelta(seconds=float(at))).isoformat(sep=" ", timespec="microseconds")
                volts = [f"{3.3 * each / 4095:.4f}" for each in counts]
                angle = [f"{each:.3f}" for each in degrees] if frame % 2 == 0 else [""] * 5
                writer.writerow([frame, moment[:26], wearing, *volts, *angle, f"{21 + at / 100:.1f}"])
                frame += 1
            began += timedelta(minutes=2)
    return [path]


SHAPES: Sequence[Callable[..., list[Path]]] = (semicolons, logger, laboratory)
