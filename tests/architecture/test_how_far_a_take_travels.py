"""How many files of models a take passes through: the fewer, the easier to follow and to change.

Counts files whose functions are called, not those that are only imported. Effects, covariance functions and
regression are counted elsewhere: each is a catalogue behind one interface.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType

import glovecal_models
from glovecal_models.calibration.training import train
from glovecal_models.calibration.training_settings import TrainingSettings
from glovecal_models.diagnosis.diagnose import diagnose
from glovecal_models.effects.catalogue import catalogue
from glovecal_models.layout import Layout
from glovecal_models.simulation.causes.form import Cause
from glovecal_models.simulation.session import record_session
from glovecal_models.simulation.session_plan import SessionPlan
from glovecal_models.takes.take import Take

MODELS = Path(glovecal_models.__file__).parent
APART = ("effects", "covariance", "regression")
MOST_IN_DIAGNOSE = 30
"""Four of them are the noise floor, which every verb asks for in the same way; two are what readings show of
their own faults, which an examined glove asks for too; the rules, the state that they pass on and what they
name are three."""
MOST_IN_TRAIN = 14
SENSORS = ("I_MCP", "I_PIP")
LAYOUT = Layout.from_columns("two", SENSORS, SENSORS)


def recorded() -> list[Take]:
    plan = SessionPlan(seed=5, sensors=SENSORS, wearings=2, takes_per_wearing=2, take_s=10.0)
    return list(record_session(plan, [Cause("hysteresis", strength_deg=3.0, channels=("I_PIP",))]).takes)


@contextmanager
def noted(files: set[str]) -> Iterator[None]:
    """Adds the files of models whose functions are called meanwhile."""

    seen = set[str]()

    def note(frame: FrameType, event: str, argument: object) -> None:
        code = frame.f_code
        if event != "call" or code.co_name == "<module>" or code.co_filename in seen:
            return
        seen.add(code.co_filename)
        if Path(code.co_filename).is_relative_to(MODELS):
            files.add(Path(code.co_filename).relative_to(MODELS).as_posix())

    before = sys.getprofile()
    sys.setprofile(note)
    try:
        yield
    finally:
        sys.setprofile(before)


def entered(call: Callable[[list[Take]], object]) -> list[str]:
    takes, files = recorded(), set[str]()
    catalogue()  # loads the effects: their class bodies would be taken for calls
    with noted(files):
        call(takes)
    return sorted(name for name in files if name.partition("/")[0] not in APART)


def test_a_diagnosis_passes_through_few_files() -> None:
    files = entered(lambda takes: diagnose(takes, LAYOUT))
    assert "diagnosis/diagnose.py" in files
    assert len(files) <= MOST_IN_DIAGNOSE, files


def test_training_passes_through_few_files() -> None:
    files = entered(lambda takes: train(takes, LAYOUT, "anna", TrainingSettings(samples=100)))
    assert "calibration/training.py" in files
    assert len(files) <= MOST_IN_TRAIN, files
