"""Simulated recordings for examples of docs/: ``python tests/simulated/page_recordings.py NAME``.

Writes ``NAME.csv`` into the current folder, and layouts where the example names them.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from still_take import still_take

from glovecal_models.simulation.causes.form import Cause
from glovecal_models.simulation.session import record_session
from glovecal_models.simulation.session_plan import SessionPlan
from glovecal_models.simulation.simulated_glove import SimulatedGlove
from glovecal_models.takes.take import Take
from glovecal_models.takes.write_table import write_takes

LAYOUT = """\
name = "{name}"
sensors = ["I_MCP", "M_MCP", "IM_ABD"]
[rotations]
I_MCP = ["I_MCP"]
M_MCP = ["M_MCP"]
IM_ABD = {read_from}
"""
PLAIN = """\
name = "plain"
sensors = ["I_MCP", "M_MCP", "IM_ABD", "I_PIP"]
counts = [1, 255]
[rotations]
I_MCP = ["I_MCP"]
M_MCP = ["M_MCP"]
IM_ABD = ["IM_ABD"]
I_PIP = ["I_PIP"]
"""
LARGEST_STRETCH_DEG = 8.0


def sticking() -> list[Take]:
    """Two sensors that stick by 3 degrees; three wearings of three takes."""
    sensors = ("I_PIP", "M_PIP")
    plan = SessionPlan(3, sensors=sensors, wearings=3, takes_per_wearing=3, take_s=20.0)
    return list(record_session(plan, [Cause("hysteresis", strength_deg=3.0, channels=sensors)]).takes)


def healthy() -> list[Take]:
    """Six sensors with nothing hidden in them; twelve takes of 20 s."""
    sensors = ("I_MCP", "I_PIP", "M_MCP", "M_PIP", "R_MCP", "R_PIP")
    plan = SessionPlan(3, sensors=sensors, wearings=3, takes_per_wearing=4, take_s=20.0)
    return list(record_session(plan).takes)


def product() -> list[Take]:
    """An abduction sensor that two flexions stretch by their product, which its layout lists."""
    return _product("product", '["IM_ABD", "I_MCP", "M_MCP"]', seed=3)


def unlisted() -> list[Take]:
    """The same of another glove, whose layout does not list the neighbours."""
    return _product("unlisted", '["IM_ABD"]', seed=4)


def still() -> list[Take]:
    """Joints kept still while the knuckles move, and each joint alone through its range; layout ``plain``."""
    Path("plain.toml").write_text(PLAIN)
    glove = SimulatedGlove(1)
    others = {"M_MCP": ("I_MCP", "IM_ABD"), "IM_ABD": ("I_MCP", "M_MCP"), "I_PIP": ("I_MCP", "M_MCP")}
    kept = [still_take(glove, name, moving, name=f"still-{name}") for name, moving in others.items()]
    ranges = [
        still_take(glove, None, (name,), name=f"range-{name}", seconds=6)
        for name in ("I_MCP", "M_MCP", "IM_ABD", "I_PIP")
    ]
    return [*kept, *ranges]


def _product(name: str, read_from: str, seed: int) -> list[Take]:
    Path(f"{name}.toml").write_text(LAYOUT.format(name=name, read_from=read_from))
    sensors = ("I_MCP", "M_MCP", "IM_ABD")
    plan = SessionPlan(seed, sensors=sensors, wearings=3, takes_per_wearing=3, take_s=20.0)
    return [_stretched(take) for take in record_session(plan).takes]


def _stretched(take: Take) -> Take:
    """``take`` with the product of both flexions, as shares of 90 degrees, in the abduction's reading."""
    index, middle, abduction = (
        np.interp(take.time_s, take.reference_time_s, take.reference[:, take.rotations.index(name)])
        for name in ("I_MCP", "M_MCP", "IM_ABD")
    )
    place = take.sensors.index("IM_ABD")
    counts_per_degree = np.polyfit(abduction, take.readings[:, place], 1)[0]
    stretch_deg = LARGEST_STRETCH_DEG * np.clip(index / 90, 0, 1) * np.clip(middle / 90, 0, 1)
    readings = take.readings.copy()
    readings[:, place] += counts_per_degree * stretch_deg
    return replace(take, readings=readings)


RECORDINGS: dict[str, Callable[[], list[Take]]] = {
    each.__name__: each for each in (sticking, healthy, product, unlisted, still)
}

if __name__ == "__main__":
    write_takes(RECORDINGS[sys.argv[1]](), Path(f"{sys.argv[1]}.csv"))
