"""A small simulated session with one hidden cause, as files and in stores: eight takes of two sensors."""

from __future__ import annotations

import dataclasses
from functools import cache
from pathlib import Path

import numpy as np

from glovecal_models.simulation.causes.form import Cause
from glovecal_models.simulation.session import RecordedSession, record_session
from glovecal_models.simulation.session_plan import SessionPlan
from glovecal_models.takes.write_table import write_takes

CAUSE = "hysteresis"
ROTATIONS = ("I_PIP", "M_PIP")


@cache
def sticky_session() -> RecordedSession:
    """Two wearings of four takes of 12 s; every sensor sticks by 3 degrees."""
    plan = SessionPlan(3, sensors=ROTATIONS, take_s=12, wearings=2, takes_per_wearing=4)
    return record_session(plan, [Cause(CAUSE, strength_deg=3)])


def write_sticky(folder: Path) -> Path:
    """``sticky.csv`` (all takes) and ``mute.csv`` (one more, without reference), in a folder."""
    session = sticky_session()
    write_takes(list(session.takes), folder / "sticky.csv")
    more = session.also("natural", 12, 1).take
    mute = dataclasses.replace(more, rotations=(), reference_time_s=np.empty(0), reference=np.empty((0, 0)))
    write_takes([mute], folder / "mute.csv")
    return folder / "sticky.csv"
