"""Takes with other motions of few sensors: what is exchanged, somebody else's, or wanders is told."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from glovecal_models.comparison.odd_takes import odd_takes
from glovecal_models.layout import Layout
from glovecal_models.takes.channel_faults import session_faults
from glovecal_models.takes.take import Take

SENSORS, ROTATIONS = ("A", "B", "C", "D"), ("R", "Q")
LAYOUT = Layout.from_columns("sleeve", SENSORS, ROTATIONS)
DIRECTIONS = ((1.0, 0.1), (-0.6, 0.2), (0.1, 1.0), (0.2, -0.8))
"""Of four slow motions from one rest."""


def moved(number: int, person: int = 0, late_s: float = 0.0) -> Take:
    """6 s at 40 Hz: sensors that only stretch one way, as a sleeve's do; one motion."""
    made, random = np.random.default_rng(person), np.random.default_rng([person, number])
    gain, zero = made.uniform(2, 6, (4, 2)) * [[1, 1], [-1, 1], [1, -1], [-1, -1]], made.uniform(400, 700, 4)
    time = np.arange(240) / 40
    way = np.sin(np.pi * time / 3 + 0.2) ** 2 * (1 + 0.2 * np.sin(time))
    angles = 30 * way[:, None] * np.array(DIRECTIONS[number]) + [-5.0, 3.0]
    pulled = angles @ gain.T
    readings = zero + np.where(pulled > 0, pulled, 0.2 * pulled) + random.normal(size=(240, 4))
    measured = angles + 0.2 * random.normal(size=angles.shape)
    return Take(f"t{number}", "w", SENSORS, time, np.round(readings, 1), ROTATIONS, time + late_s, measured)


def session(late_s: float = 0.0) -> list[Take]:
    return [moved(number, late_s=late_s) for number in range(4)]


@pytest.mark.parametrize("late_s", [0.0, -0.6], ids=["one clock", "another clock"])
def test_takes_that_belong_together_are_not_told(late_s: float) -> None:
    assert [item for item in odd_takes(session(late_s), LAYOUT) if item.is_set_aside] == []


@pytest.mark.parametrize("late_s", [0.0, -0.6], ids=["one clock", "another clock"])
@pytest.mark.parametrize("number", range(4))
def test_two_sensors_that_are_exchanged_in_one_take(number: int, late_s: float) -> None:
    takes = session(late_s)
    takes[number] = replace(takes[number], readings=takes[number].readings[:, [0, 3, 2, 1]])
    [found] = odd_takes(takes, LAYOUT)
    assert (found.place, found.how) == (number, "sensors")
    assert f"'t{number}' does not fit the others: where joints stand alike" in found.sentence
    assert "sensor columns B and D are exchanged" in found.sentence
    assert found.is_set_aside
    assert found.fitted_deg < 0.5 * found.error_deg


def test_two_references_that_are_exchanged_in_one_take() -> None:
    takes = session()
    takes[2] = replace(takes[2], reference=takes[2].reference[:, ::-1])
    [found] = odd_takes(takes, LAYOUT)
    assert (found.place, found.how) == (2, "rotations")
    assert "reference columns R and Q are exchanged" in found.sentence


def test_a_take_of_somebody_else() -> None:
    takes = session()
    takes[1] = replace(moved(1, person=3), name="t1")
    [found] = odd_takes(takes, LAYOUT)
    assert (found.place, found.how) == (1, "level")
    assert "Another person" in found.sentence


def test_a_reference_that_wanders_in_one_take() -> None:
    takes = session()
    reference = takes[3].reference + np.linspace(0, 9, 240)[:, None] * [0, 1]
    takes[3] = replace(takes[3], reference=reference)
    [found] = odd_takes(takes, LAYOUT)
    assert (found.place, found.how) == (3, "wandering")
    assert "the reference of Q wanders by" in found.sentence
    assert "Record it again" in found.sentence
    assert found.told.endswith("It is set aside.")


def test_two_of_four_tell_nobody_which_is_right() -> None:
    takes = session()
    for number in (1, 2):
        takes[number] = replace(takes[number], readings=takes[number].readings[:, [0, 3, 2, 1]])
    assert [item for item in odd_takes(takes, LAYOUT) if item.in_like_postures] == []


def of_rows(take: Take, frames: int, rows: int) -> Take:
    """The first ones."""
    return replace(
        take, time_s=take.time_s[:frames], readings=take.readings[:frames],
        reference_time_s=take.reference_time_s[:rows], reference=take.reference[:rows],
    )  # fmt: skip


def with_gaps(take: Take) -> Take:
    """Measured by a source that states deviations, and leaves angles out."""
    reference = take.reference.copy()
    reference[30:90, 0] = reference[100:180, 1] = np.nan
    return replace(take, reference=reference, reference_sd=np.where(np.isfinite(reference), 0.5, np.nan))


def unmeasured(take: Take) -> Take:
    return replace(take, reference=np.full_like(take.reference, np.nan))


PECULIAR = {
    "no frame": lambda take: of_rows(take, 0, 0),
    "one frame": lambda take: of_rows(take, 1, 1),
    "two frames": lambda take: of_rows(take, 2, 2),
    "no row of the reference": lambda take: of_rows(take, 240, 0),
    "no angle measured": unmeasured,
    "gaps, and deviations": with_gaps,
    "all sensors stand": lambda take: replace(take, readings=np.full_like(take.readings, 500.0)),
}


@pytest.mark.parametrize("late_s", [0.0, -0.6], ids=["one clock", "another clock"])
@pytest.mark.parametrize("how_many", [1, 4])
@pytest.mark.parametrize("name", PECULIAR)
def test_whatever_a_take_may_be_ends_in_an_answer(name: str, how_many: int, late_s: float) -> None:
    takes = session(late_s)
    takes[:how_many] = [PECULIAR[name](take) for take in takes[:how_many]]
    odd = [item for item in odd_takes(takes, LAYOUT) if item.is_set_aside]
    assert len(odd) < len(takes) / 2
    assert all(str(fault) for _, fault in session_faults(takes, SENSORS))
