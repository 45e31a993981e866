"""Takes for the store's tests: a small layout, smooth made-up motion, reference by a known formula."""

from __future__ import annotations

import numpy as np

from glovecal_models.layout import Layout
from glovecal_models.takes.take import Take

LAYOUT = Layout.from_toml("""
name = "two-fingers"
sensors = ["I_MCP", "I_PIP", "IM_ABD"]
[rotations]
I_MCP = ["I_MCP"]
I_PIP = ["I_PIP"]
IM_ABD = ["IM_ABD", "I_MCP"]
[simulated]
I_DIP = "2/3 * I_PIP"
""")


def make_take(seed: int, name: str = "bending", frames: int = 300, *, measured: bool = True) -> Take:
    """Readings of three sensors at 60 Hz; the third is stretched by the first. Noise 0.3 degrees."""
    rng = np.random.default_rng(seed)
    time = np.arange(frames) / 60
    phases = rng.uniform(0, 6, (3, 3))
    waves = np.sin(time[:, None, None] * np.array([0.7, 1.3, 2.1]) + phases).sum(axis=2)
    angles = np.array([45, 50, 0]) + np.array([14, 15, 5]) * waves
    readings = np.column_stack(
        [
            40 + 1.1 * angles[:, 0] + 6 * np.sin(angles[:, 0] / 30),
            60 + 1.4 * angles[:, 1],
            130 + 3 * angles[:, 2] + 0.2 * angles[:, 0],
        ]
    )
    return Take(
        name=name,
        wearing="first",
        sensors=LAYOUT.sensors,
        time_s=time,
        readings=np.round(readings),
        rotations=("I_MCP", "I_PIP", "IM_ABD") if measured else (),
        reference_time_s=time if measured else np.empty(0),
        reference=angles + rng.normal(0, 0.3, angles.shape) if measured else np.empty((0, 0)),
        context={"supply_v": np.full(frames, 4.9)},
        poses=tuple("fist" if value > 60 else "" for value in angles[:, 0]),
        simulated=True,
    )
