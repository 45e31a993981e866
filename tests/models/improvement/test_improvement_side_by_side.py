"""An improvement is the same to the last digit, however many processes work on it."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from glovecal_models.calibration.artifact import dump
from glovecal_models.calibration.training_settings import TrainingSettings
from glovecal_models.errors import Cancelled
from glovecal_models.improvement.improve import improve
from glovecal_models.improvement.text import improved
from glovecal_models.layout import Layout
from glovecal_models.simulation.causes.form import Cause
from glovecal_models.simulation.session import record_session
from glovecal_models.simulation.session_plan import SessionPlan
from glovecal_models.takes.take import Take

SENSORS = ("I_MCP", "I_PIP")
LAYOUT = Layout.from_columns("two", SENSORS, SENSORS)
SETTINGS = TrainingSettings(samples=300)


def strided(take: Take) -> Take:
    """Its arrays as columns of one table, as a file's may be: a worker gets them one after another."""

    def spread(array: np.ndarray) -> np.ndarray:
        return np.repeat(array, 2, axis=-1)[..., ::2]

    context = {name: spread(values) for name, values in take.context.items()}
    return replace(take, readings=spread(take.readings), reference=spread(take.reference), context=context)


@pytest.fixture(scope="module")
def takes() -> list[Take]:
    plan = SessionPlan(seed=5, sensors=SENSORS, wearings=2, takes_per_wearing=3, take_s=12.0)
    cause = Cause("hysteresis", "single_play", strength_deg=3.0, channels=("I_PIP",))
    return [strided(take) for take in record_session(plan, [cause]).takes]


def test_the_number_of_processes_changes_no_digit(takes) -> None:
    found = [
        improve(takes, LAYOUT, "anna", SETTINGS, max_steps=1, ceiling=True, workers=workers)
        for workers in (1, 2, 4)
    ]
    assert [item.added and item.added.effect for item in found[0].steps] == [None, "hysteresis"]
    for one, other in pairwise(found):
        assert [dump(model) for model in one.models] == [dump(model) for model in other.models]
        assert repr(improved(one)) == repr(improved(other))


def test_a_cancel_ends_its_processes(takes) -> None:
    said: list[str] = []

    def is_enough() -> bool:
        return any("held-out takes" in sentence for sentence in said)

    with pytest.raises(Cancelled):
        improve(
            takes, LAYOUT, "anna", SETTINGS, workers=2,
            cancelled=is_enough, report=lambda sentence, _: said.append(sentence),
        )  # fmt: skip
