"""The loop on real recordings: clocks first, nothing invented, rivals left as rivals, wearings asked for."""

from __future__ import annotations

from pathlib import Path

import pytest

from glovecal_models.calibration.training_settings import TrainingSettings
from glovecal_models.diagnosis.diagnose import diagnose
from glovecal_models.improvement.improve import improve
from glovecal_models.improvement.text import improvement_sentences
from glovecal_models.layout import Layout
from glovecal_models.takes.table import read_takes
from glovecal_models.takes.take import Take

DATA = Path(__file__).parents[4] / "shared" / "data"
pytestmark = pytest.mark.needs_shared_data


def recorded(pattern: str) -> tuple[list[Take], Layout]:
    takes = [take for path in sorted(DATA.glob(pattern)) for take in read_takes(path)]
    return takes, Layout.from_columns("recorded", takes[0].sensors, takes[0].rotations)


@pytest.mark.parametrize("placement", ["P300-placement1", "P304-placement2"])
def test_an_ankle_is_put_right_by_its_clocks(placement):
    takes, layout = recorded(f"ankle/{placement}-*.frames.csv")
    found = improve(takes, layout, placement, TrainingSettings(method="linear"), max_steps=1)
    added = found.steps[1].added
    assert added is not None
    assert (added.effect, added.verdict) == ("clock_offset", "named")
    assert all(-3 < offset < -0.15 for offset in added.parameters["offset_s"].values())
    assert len(set(added.parameters["offset_s"].values())) == 4, "each take has its own"
    assert found.steps[0].rmse_deg > 10
    assert found.steps[1].rmse_deg < 4


def test_known_angles_leave_curve_and_jump_open():
    takes, layout = recorded("flex-static/one-sensor.csv")
    found = improve(takes, layout, "bench", TrainingSettings(method="linear"))
    added = found.steps[1].added
    assert added is not None
    assert added.verdict == "ambiguous"
    assert added.confidence_set == ("nonlinearity", "sensor_fault")
    assert found.steps[0].rmse_deg == pytest.approx(10.5, abs=0.5)
    assert found.steps[1].rmse_deg < 6.0
    assert found.stopped == "ambiguous"
    assert found.next_take is not None
    assert "another order" in found.next_take.what


@pytest.mark.parametrize("walker", ["P002-*-L", "P002-*-R", "P003-*-L", "P003-*-R"])
def test_a_few_strides_give_nothing_a_name(walker):
    takes, layout = recorded(f"gait/{walker}-*.csv")
    found = diagnose(takes, layout)
    assert found.named is None
    assert "creep" in {item.effect for item in found.not_identifiable}


def test_single_poses_of_a_robot_thumb_judge_nothing_that_lasts():
    takes, _ = recorded("cyberglove-robot-thumb/*.csv")
    alive = [name for name in takes[0].sensors if name not in ("G08", "G16")]
    found = diagnose(takes, Layout.from_columns("thumb", alive, takes[0].rotations))
    assert found.named is None
    why = {item.effect: item.why for item in found.not_identifiable}
    assert {"lag", "clock_offset", "creep", "hysteresis"} <= set(why)
    assert why["creep"] == "the frames are single poses; record the movement from one to the next"


@pytest.mark.parametrize("person", ["P301", "P304"])
def test_three_placements_of_an_ankle_are_a_donning_shift(person):
    takes, layout = recorded(f"ankle/{person}-placement?-*.frames.csv")
    found = improve(takes, layout, person, TrainingSettings(method="linear"), max_steps=2)
    added = [step.added for step in found.steps if step.added is not None]
    assert [item.effect for item in added] == ["clock_offset", "donning_shift"]
    assert added[1].verdict == "named"
    assert found.diagnosis is not None
    assert found.diagnosis.residual.is_significant


@pytest.mark.parametrize("person", ["P300", "P301"])
def test_two_placements_cannot_decide(person):
    takes, layout = recorded(f"ankle/{person}-placement[23]-*.frames.csv")
    found = improve(takes, layout, person, TrainingSettings(method="linear"), max_steps=2)
    added = {step.added.effect for step in found.steps if step.added is not None}
    assert added <= {"clock_offset", "nonlinearity"}
    assert any(
        "Take the glove off and put it on again, then record 4 takes" in sentence
        and "donning_shift" in sentence.partition("Can be judged then: ")[2]
        for sentence in improvement_sentences(found)
    )
    assert found.next_take is not None
    assert found.next_take.separates == ("donning_shift", "chance")
    assert "put it on again" in found.next_take.what
    assert found.diagnosis is not None
    assert found.diagnosis.residual.is_significant
