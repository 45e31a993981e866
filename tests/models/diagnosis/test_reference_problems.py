"""A measurement that is wrong is said before any effect is blamed."""

from dataclasses import replace

import numpy as np
import pytest

from glovecal_models.diagnosis.reference_problems import reference_problems
from glovecal_models.layout import Layout
from glovecal_models.takes.take import Take

LAYOUT = Layout.from_columns("one", ["I_PIP"], ["I_PIP"])


@pytest.fixture
def takes() -> list[Take]:
    time = np.arange(0, 10, 1 / 60)
    random = np.random.default_rng(0)
    found = []
    for number in range(4):
        angle = 40 + 30 * np.sin(time * (1 + 0.1 * number)) + 0.3 * random.normal(size=len(time))
        found.append(
            Take(
                name=f"t{number}", wearing="w", sensors=("I_PIP",), time_s=time,
                readings=(60 + 1.2 * angle)[:, None], rotations=("I_PIP",),
                reference_time_s=time, reference=angle[:, None],
            )
        )  # fmt: skip
    return found


def changed(takes: list[Take], reference: np.ndarray) -> list[Take]:
    return [*takes[:3], replace(takes[3], reference=reference)]


def test_a_good_reference_is_passed_over(takes):
    assert reference_problems(takes, LAYOUT) == ()


def test_radians_are_recognised(takes):
    radians = [replace(take, reference=np.radians(take.reference)) for take in takes]
    assert "look like radians" in reference_problems(radians, LAYOUT)[0]


def test_a_flipped_sign_is_recognised(takes):
    [problem] = reference_problems(changed(takes, -takes[3].reference), LAYOUT)
    assert problem.startswith("I_PIP in take t3")
    assert "sign flipped" in problem


def test_a_frozen_reference_is_recognised(takes):
    [problem] = reference_problems(changed(takes, np.full_like(takes[3].reference, 20.0)), LAYOUT)
    assert "frozen" in problem


def test_a_jumping_reference_is_recognised(takes):
    reference = takes[3].reference.copy()
    reference[200:260] += 60.0
    [problem] = reference_problems(changed(takes, reference), LAYOUT)
    assert "jumps by more than 25 degrees 2 times" in problem
