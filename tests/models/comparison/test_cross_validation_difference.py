"""Two models of disjoint halves: where they differ by more than they claim, the model is wrong."""

from __future__ import annotations

import numpy as np

from glovecal_models.calibration.training import train
from glovecal_models.calibration.training_settings import TrainingSettings
from glovecal_models.comparison.compare import cross_validation_difference
from glovecal_models.comparison.where.answer import cross_validation_sentences
from glovecal_models.layout import Layout
from glovecal_models.takes.take import Take

LAYOUT = Layout.from_columns("one", ("I_MCP",), ("I_MCP",))
LINEAR = TrainingSettings(method="linear", folds=0)


def takes(bend: float) -> list[Take]:
    """Every other take stays in the lower half of the range; ``bend``: a curve that no line follows."""
    found = []
    for number in range(4):
        generator = np.random.default_rng(number)
        time = np.arange(300) / 30.0
        span = 20.0 if number % 2 else 40.0
        angle = span + span * np.sin(0.9 * time + number)
        reading = 10.0 * (angle + bend * (angle / 40.0) ** 2 + generator.normal(0.0, 0.5, len(time)))
        found.append(
            Take(
                f"take {number}", "one", ("I_MCP",), time, reading[:, None], ("I_MCP",), time, angle[:, None]
            )
        )
    return found


def test_a_straight_sensor_agrees_with_itself_and_a_bent_one_does_not():
    straight, bent = takes(0.0), takes(12.0)
    agreed = cross_validation_difference(train(straight, LAYOUT, "anna", LINEAR), straight)
    assert agreed is not None
    assert not any(region.is_significant for region in agreed.regions)
    assert "nowhere far above" in cross_validation_sentences(agreed)[0]
    found = cross_validation_difference(train(bent, LAYOUT, "anna", LINEAR), bent)
    assert found is not None
    assert found.halves == (("take 0 (1)", "take 2 (3)"), ("take 1 (2)", "take 3 (4)"))
    worst = found.regions[0]
    assert worst.is_significant
    assert worst.high_deg > 60, "where one half has seen nothing"
    assert "the model, not the noise, is wrong here. I_MCP at" in cross_validation_sentences(found)[0]


def test_two_takes_are_too_few():
    few = takes(0.0)[:2]
    found = cross_validation_difference(train(few, LAYOUT, "anna", LINEAR), few)
    assert found is None
    assert "each half needs two takes" in cross_validation_sentences(found)[0]
