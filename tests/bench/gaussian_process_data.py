"""Synthetic glove recordings for the Gaussian-process bench: 22 rotations, 8-bit cross-coupled sensors.

One seed, one minute of smooth motion. Three rotations depend on a joint that no sensor of theirs
measures, as happens on real hands; there the likelihood has no good optimum and peers differ most.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter1d

NOISE_DEG = 1.0
FRAMES_PER_SECOND = 30.0
MISSING_INPUT = ("T_VIR", "TI_ABD", "RP_ABD")

OUTPUTS: dict[str, tuple[str, ...]] = {
    "T_TMC": ("T_TMC", "T_MCP"),
    "TI_ABD": ("TI_ABD", "T_TMC"),
    "T_VIR": ("T_TMC", "TI_ABD", "T_MCP"),
    "T_MCP": ("T_MCP", "T_TMC", "T_IP"),
    "T_IP": ("T_IP", "T_MCP"),
    "I_MCP": ("I_MCP",),
    "I_PIP": ("I_PIP",),
    "I_DIP": ("I_PIP",),
    "IM_ABD": ("IM_ABD", "I_MCP", "M_MCP"),
    "M_MCP": ("M_MCP",),
    "M_PIP": ("M_PIP",),
    "M_DIP": ("M_PIP",),
    "R_MCP": ("R_MCP",),
    "R_PIP": ("R_PIP",),
    "R_DIP": ("R_PIP",),
    "MR_ABD": ("MR_ABD", "M_MCP", "R_MCP"),
    "P_MCP": ("P_MCP",),
    "P_PIP": ("P_PIP",),
    "P_DIP": ("P_PIP",),
    "RP_ABD": ("RP_ABD", "R_MCP", "P_MCP"),
    "W_FLEX": ("W_FLEX", "W_ABD"),
    "W_ABD": ("W_ABD", "W_FLEX"),
}
"""The sensors each rotation is read from, in the manner of Wang & Neff 2013, Table 1."""


@dataclass(frozen=True)
class Joint:
    """Training and later frames of one rotation: ``inputs`` raw counts, ``target`` degrees."""

    name: str
    inputs: np.ndarray
    target: np.ndarray
    test_inputs: np.ndarray
    test_truth: np.ndarray
    """Noise-free degrees of frames recorded later."""


def one_joint(frames: int = 2000, seed: int = 7) -> Joint:
    """A cross-coupled abduction, D = 3, whose inputs the glove measures completely."""
    return whole_glove(frames, seed)["MR_ABD"]


def whole_glove(frames: int = 2000, seed: int = 7) -> dict[str, Joint]:
    """All 22 rotations; of 1.5 x ``frames`` recorded, the first ``frames`` are for training."""
    generator = np.random.default_rng(seed)
    total = frames + frames // 2
    angles = _angles(total, generator)
    readings = _readings(angles, generator)
    joints = {}
    for name, sensors in OUTPUTS.items():
        inputs = np.column_stack([readings[sensor] for sensor in sensors])
        noisy = angles[name] + NOISE_DEG * generator.standard_normal(total)
        joints[name] = Joint(name, inputs[:frames], noisy[:frames], inputs[frames:], angles[name][frames:])
    return joints


def _angles(total: int, generator: np.random.Generator) -> dict[str, np.ndarray]:
    names = [name for name in OUTPUTS if not name.endswith(("_DIP", "_VIR"))]
    angles = {}
    grip = _motion(total, generator)
    for name in names:
        own = _motion(total, generator)
        if "ABD" in name:
            angles[name] = 12.0 * own
        elif name.startswith(("I_", "M_", "R_", "P_")):
            angles[name] = 45.0 + 40.0 * np.tanh(0.7 * grip + 0.7 * own)
        else:
            angles[name] = 20.0 + 18.0 * own
    hidden = _motion(total, generator)
    angles["T_VIR"] = 0.5 * angles["T_TMC"] + 0.4 * angles["TI_ABD"] + 6.0 * hidden
    for finger in "IMRP":
        bend = angles[f"{finger}_PIP"]
        angles[f"{finger}_DIP"] = 0.55 * bend + 12.0 * np.sin(np.radians(1.8 * bend))
    return angles


def _motion(total: int, generator: np.random.Generator) -> np.ndarray:
    """Band-limited random motion, unit standard deviation: half a second to two seconds a gesture."""
    slow = gaussian_filter1d(generator.standard_normal(total), 1.2 * FRAMES_PER_SECOND, mode="wrap")
    fast = gaussian_filter1d(generator.standard_normal(total), 0.35 * FRAMES_PER_SECOND, mode="wrap")
    motion = slow / slow.std() + 0.6 * fast / fast.std()
    return motion / motion.std()


def _readings(angles: dict[str, np.ndarray], generator: np.random.Generator) -> dict[str, np.ndarray]:
    readings = {}
    for name in sorted({sensor for sensors in OUTPUTS.values() for sensor in sensors}):
        bend = angles[name] - angles[name].mean()
        signal = bend + 0.15 * bend**2 / (10.0 + np.abs(bend))
        for other in OUTPUTS[name][1:]:
            pull = (angles[other] - angles[other].mean()) / angles[other].std()
            signal = signal + 5.0 * np.tanh(0.5 * pull + 0.2) + 0.05 * bend * pull
        if name in MISSING_INPUT:
            signal = signal + 5.0 * _motion(len(bend), generator)
        spread = np.abs(signal).max()
        readings[name] = np.clip(np.round(128.0 + 110.0 * signal / spread), 0.0, 255.0)
    return readings
