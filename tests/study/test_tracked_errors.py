"""What is told of the tracker's errors, from errors that are known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from simulated_camera import lasting_noise
from tracked_errors import correlations, table, trailing_s
from tracked_hands import TrackedHand, cameras

from glovecal_models.colour_glove.hand_state import FINGER_ROTATIONS


def known(number: int, *, stays: float, lasts_s: float, times: float) -> TrackedHand:
    rng, frames = np.random.default_rng([number, 3]), np.arange(600)
    columns = len(FINGER_ROTATIONS)
    truth = 30.0 + 15.0 * lasting_noise(frames / 30.0, columns, 0.5, rng)
    error = np.sqrt(1 - stays**2) * lasting_noise(frames / 30.0, columns, lasts_s / 2, rng)
    error += stays * rng.standard_normal(columns)
    sd, accepted = np.full_like(truth, 4.0), np.ones(truth.shape, bool)
    return TrackedHand("soft", frames, truth, 4.0 * times * error, sd, accepted, (90, 100), None)


def test_how_large_and_how_lasting_errors_are_is_told():
    hands = [known(number, stays=0.5, lasts_s=0.8, times=1.3) for number in range(20)]
    at, correlation = correlations(hands)
    assert correlation[0] == pytest.approx(1.0)
    assert correlation[at >= 2.0].mean() == pytest.approx(0.25, abs=0.06)
    text = table(hands)
    assert float(text.partition("RMS ")[2].partition(" degrees")[0]) == pytest.approx(5.2, abs=0.2)
    lasting = float(text.partition("Errors last ")[2].partition(" s")[0])
    assert lasting == pytest.approx(0.8, abs=0.12)
    assert "lean to the prior 0.0" in text.replace("-0.0", "0.0")
    assert "In soft light 90 % of the glove's pixels are right" in text
    kinds = [line.split("|")[1].strip() for line in text.splitlines() if line.startswith("| ")][1:]
    assert kinds == ["MCP", "PIP", "DIP", "IP", "TMC", "ABD", "VIR"]


def test_how_late_estimates_come_is_told():
    one = known(3, stays=0.5, lasts_s=0.8, times=0.5)
    late = np.column_stack([np.interp(one.frames - 0.6, one.frames, column) for column in one.truth.T])
    trailing = replace(one, error=one.error + late - one.truth)
    assert trailing_s(trailing) - trailing_s(one) == pytest.approx(0.02, abs=0.003)
    assert "ms late, SD" in table([one, trailing])


def test_the_second_camera_looks_at_the_same_place_from_the_side():
    first, second = cameras(2)
    middle = np.array([0.0, 0.0, 470.0])
    seen = np.array(second.rotation) @ middle + np.array(second.translation_mm)
    assert seen == pytest.approx(middle)
    turn = np.arccos((np.trace(np.array(second.rotation)) - 1) / 2)
    assert np.degrees(turn) == pytest.approx(60.0)
    assert first.translation_mm == (0.0, 0.0, 0.0)
