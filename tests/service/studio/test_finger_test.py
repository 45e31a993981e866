"""Which sensor answers a finger: in counts, against the noise of a hand held still."""

from __future__ import annotations

import numpy as np

from glovecal_service.studio.finger_test import LEAST_STILL, FingerTest

SENSORS = ("I_MCP", "I_PIP", "M_MCP", "T_MCP")
REST = np.array([80.0, 120.0, 90.0, 60.0])


def held(test: FingerTest, random: np.random.Generator) -> None:
    for _ in range(LEAST_STILL - 1):
        assert not test.hold(np.rint(REST + random.normal(0.0, 0.6, 4)))
    assert test.hold(np.rint(REST + random.normal(0.0, 0.6, 4)))


def test_the_columns_that_answer_are_told_from_what_is_pulled_along() -> None:
    random = np.random.default_rng(3)
    test = FingerTest(SENSORS)
    held(test, random)
    for share in np.linspace(0.0, 1.0, 20):
        moved = share * np.array([70.0, 60.0, 9.0, 0.0])
        test.move(np.rint(REST + moved + random.normal(0.0, 0.6, 4)))
    answered, pulled = test.answered()
    assert {item.sensor for item in answered} == {"I_MCP", "I_PIP"}
    assert [item.sensor for item in pulled] == ["M_MCP"]
    largest = next(item for item in answered if item.sensor == "I_MCP")
    assert 68 < largest.moved_counts < 73
    assert 0.3 <= largest.noise_counts < 1.5


def test_a_hand_that_only_trembles_answers_with_nothing() -> None:
    random = np.random.default_rng(4)
    for _ in range(20):
        test = FingerTest(SENSORS)
        held(test, random)
        for _ in range(50):
            test.move(np.rint(REST + random.normal(0.0, 0.6, 4)))
        assert test.answered() == ([], [])


def test_a_moving_hand_is_waited_for_until_it_is_still() -> None:
    random = np.random.default_rng(5)
    test = FingerTest(SENSORS)
    for at in range(3 * LEAST_STILL):
        assert not test.hold(REST + 40.0 * np.sin(at / 5.0) + random.normal(0.0, 0.6, 4))
    held(test, random)
