"""Real recordings: an ankle sleeve of four stretch sensors, put on three times by one person."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.predictor import GlovePredictor
from glovecal_models.calibration.training import train
from glovecal_models.calibration.training_settings import TrainingSettings
from glovecal_models.improvement.add_effect import add_effect
from glovecal_models.layout import Layout
from glovecal_models.quick_check.held_poses import HeldPose
from glovecal_models.quick_check.quick_check import quick_check
from glovecal_models.takes.clock_scan import aligned, clock_offsets
from glovecal_models.takes.table import read_takes
from glovecal_models.takes.take import Take

ANKLE = Path(__file__).parents[4] / "shared" / "data" / "ankle"
SAMPLE_FRAMES = 20
pytestmark = pytest.mark.needs_shared_data


def samples(takes: list[Take]) -> list[HeldPose]:
    """Two short pieces of each take, a third and two thirds through what was measured."""
    found = []
    for take in takes:
        known = np.flatnonzero(np.isfinite(take.reference_at_frames(take.rotations)).all(axis=1))
        for third in (1, 2):
            start = int(known[third * len(known) // 3])
            found.append(HeldPose(take, np.arange(start, min(start + SAMPLE_FRAMES, len(take.time_s)))))
    return found


def rmse(model: CalibrationModel, takes: list[Take], used: list[HeldPose]) -> float:
    """Of all frames that no sample used, degrees."""
    predictor, errors = GlovePredictor(model), []
    for take in takes:
        angles = predictor.predict_take(take.time_s, take.readings, take.context, take.wearing).mean
        error = angles - take.reference_at_frames(model.rotation_names)
        for pose in used:
            if pose.take is take:
                error[pose.frames] = np.nan
        errors.append(error)
    return float(np.sqrt(np.nanmean(np.concatenate(errors) ** 2)))


def test_samples_of_a_third_placement_put_it_right_in_part() -> None:
    """8.0 degrees become 4: offset and gain of each rotation; what is left are four gains, one a sensor."""
    takes = [take for path in sorted(ANKLE.glob("P300-*.frames.csv")) for take in read_takes(path)]
    takes = [aligned(take, found.offset_s) for take, found in zip(takes, clock_offsets(takes), strict=True)]
    takes = [replace(take, wearing="-".join(take.name.split("-")[:2])) for take in takes]
    new = [take for take in takes if take.wearing.endswith("placement1")]
    training = [take for take in takes if not take.wearing.endswith("placement1")]
    layout = Layout.from_columns("ankle", takes[0].sensors, takes[0].rotations)
    settings = TrainingSettings(method="linear", folds=2)
    plain = train(training, layout, "p300", settings)
    model = add_effect(plain, training, "donning_shift", settings=settings, least_gain=-9).model
    used = samples(new)
    before = rmse(model, new, used)
    five, eight = (rmse(quick_check(model, new, poses=used[:count]).model, new, used) for count in (5, 8))
    assert before > 6
    assert five < 0.75 * before
    assert eight < 0.6 * before
