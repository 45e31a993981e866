"""Three to five poses of a new wearing: how much error they save, what they cannot tell, what is refused."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import pytest

from glovecal_models.calibration.artifact import dump, load
from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.predictor import GloveAngles, GlovePredictor
from glovecal_models.calibration.samples import sensor_sensitivity
from glovecal_models.calibration.training import train
from glovecal_models.calibration.training_settings import TrainingSettings, requested_effects
from glovecal_models.errors import BadInput
from glovecal_models.improvement.add_effect import add_effect
from glovecal_models.layout import Layout
from glovecal_models.quick_check.held_poses import held_poses, own_poses
from glovecal_models.quick_check.quick_check import quick_check
from glovecal_models.simulation.causes.form import Cause
from glovecal_models.simulation.session import record_session
from glovecal_models.simulation.session_plan import SessionPlan
from glovecal_models.takes.take import Take

SENSORS = ("I_MCP", "I_PIP", "M_MCP")
NEW = "wearing-4"


@dataclass(frozen=True)
class Glove:
    """Three wearings to learn from, and a fourth: its poses, and two takes of natural motion."""

    layout: Layout
    training: list[Take]
    poses: Take
    natural: Take
    other: Take
    plain: CalibrationModel
    model: CalibrationModel
    """With the effect, learned from the training takes."""

    @property
    def ranges(self) -> dict[str, float]:
        found = sensor_sensitivity(self.model)
        return dict(zip(found.sensors, found.range.tolist(), strict=True))


@cache
def glove(seed: int, form: str, method: str = "linear") -> Glove:
    plan = SessionPlan(
        seed, sensors=SENSORS, wearings=3, takes_per_wearing=2, take_s=12, motions=("natural", "poses")
    )
    session = record_session(plan, [Cause("donning_shift", strength_deg=4, form=form)])
    layout = replace(Layout.from_columns("three", SENSORS, SENSORS), counts=(0.0, 255.0))
    training = list(session.takes)
    poses, natural, other = (
        session.also("poses", 10, 3).take,
        session.also("natural", 10, 3).take,
        session.also("natural", 10, 3, repeat=1).take,
    )
    settings = TrainingSettings(method=method, folds=2, samples=200)  # pyright: ignore[reportArgumentType]
    plain = train(training, layout, "anna", settings)
    model = add_effect(plain, training, "donning_shift", settings=settings, least_gain=-9).model
    return Glove(layout, training, poses, natural, other, plain, model)


def curved() -> Glove:
    return glove(2, "offset_and_gain", "lmc_gpr")


def predicted(model: CalibrationModel, take: Take) -> GloveAngles:
    return GlovePredictor(model).predict_take(take.time_s, take.readings, take.context, take.wearing)


def rmse(model: CalibrationModel, take: Take) -> float:
    error = predicted(model, take).mean - take.reference_at_frames(model.rotation_names)
    return float(np.sqrt(np.nanmean(error**2)))


def unmeasured(take: Take, rotations: tuple[str, ...] = ()) -> Take:
    """The take with a reference of some rotations only."""
    kept = [take.rotations.index(name) for name in rotations]
    return replace(take, rotations=rotations, reference_time_s=take.time_s, reference=take.reference[:, kept])


@pytest.mark.parametrize("form", ["offset", "offset_and_gain"])
def test_a_few_poses_come_near_a_full_calibration(form: str) -> None:
    """Per glove: nothing, 3 poses, 5 poses, and a calibration on the wearing's own takes."""
    errors = []
    for seed in (1, 2, 3):
        it = glove(seed, form)
        held, _ = held_poses(it.poses, it.ranges)
        full = train([it.other, it.poses], it.layout, "anna", TrainingSettings(method="linear", folds=0))
        errors.append([rmse(it.model, it.natural)])
        for count in (3, 5):
            checked = quick_check(it.model, [it.poses], poses=held[:count]).model
            errors[-1].append(rmse(checked, it.natural))
        errors[-1].append(rmse(full, it.natural))
    before, three, five, full = np.median(errors, axis=0)
    assert before > 3
    assert three < 0.55 * before
    assert five < 1.4 * full


def test_the_curved_regressor_too() -> None:
    it = curved()
    found = quick_check(it.model, [it.poses], parent_id="0" * 64)
    assert rmse(found.model, it.natural) < 0.35 * rmse(it.model, it.natural)
    assert found.model.parent == "0" * 64
    expected = found.report.expected
    assert expected.full_calibration_deg < expected.after_deg < 0.75 * expected.now_deg
    assert found.report.poses_held_out_deg is not None
    assert found.report.poses_held_out_deg < 0.4 * found.report.poses_before_deg
    assert found.report.sentences[0].startswith("As found: ")
    assert any("the expected error in this wearing falls from" in item for item in found.report.sentences)


def test_without_the_effect_a_default_prior_is_taken() -> None:
    it = glove(2, "offset")
    one = [take for take in it.training if take.wearing == "wearing-1"]
    model = train(one, it.layout, "anna", TrainingSettings(method="linear", folds=0))
    found = quick_check(model, [it.poses])
    assert rmse(found.model, it.natural) < 0.6 * rmse(model, it.natural)
    assert [item.name for item in found.model.effects] == ["donning_shift"]
    assert requested_effects(found.model) == (), "learned anew from the training takes it would be nothing"
    mixed = quick_check(it.plain, [it.poses], trained_wearings=["wearing-1", "wearing-2"])
    assert "2 wearings without separating them" in mixed.report.sentences[-1]


def test_the_interval_is_as_wide_as_what_is_not_known() -> None:
    it = curved()
    checked = quick_check(it.model, [it.poses]).model
    base = GlovePredictor(it.model).predict(it.natural.readings).sd
    trained = replace(it.natural, wearing="wearing-2")
    before, after = predicted(it.model, it.natural), predicted(checked, it.natural)
    assert (before.sd > after.sd).all()
    assert (after.sd > base).all()
    for model in (it.model, checked):
        np.testing.assert_array_equal(predicted(model, trained).sd, base)
    other = replace(it.natural, wearing="wearing-9")
    np.testing.assert_allclose(predicted(checked, other).sd, before.sd, rtol=1e-12)
    np.testing.assert_allclose(predicted(checked, other).mean, before.mean, rtol=1e-12)
    error = np.abs(after.mean - it.natural.reference_at_frames(checked.rotation_names))
    assert 0.5 < np.nanmean(error < after.sd) < 0.95


def test_the_child_is_kept_whole_and_checked_again() -> None:
    it = glove(1, "offset_and_gain")
    held, _ = held_poses(it.poses, it.ranges)
    once = quick_check(it.model, [it.poses], poses=held[:2])
    stored = load(dump(once.model))
    np.testing.assert_array_equal(predicted(stored, it.natural).mean, predicted(once.model, it.natural).mean)
    np.testing.assert_array_equal(predicted(stored, it.natural).sd, predicted(once.model, it.natural).sd)
    again, afresh = quick_check(stored, [it.poses]), quick_check(it.model, [it.poses])
    np.testing.assert_allclose(again.shift.mean, afresh.shift.mean, atol=1e-9)
    for wearing in ("wearing-1", NEW):
        take = replace(it.natural, wearing=wearing)
        np.testing.assert_allclose(
            predicted(again.model, take).mean, predicted(afresh.model, take).mean, atol=1e-9
        )
    yet_another = [replace(it.poses, wearing="wearing-5")]
    both = quick_check(afresh.model, yet_another).model
    np.testing.assert_allclose(predicted(both, it.natural).mean, predicted(afresh.model, it.natural).mean)


def test_frames_of_one_hold_are_one_witness() -> None:
    it = glove(1, "offset_and_gain")
    held, _ = held_poses(it.poses, it.ranges)
    whole = quick_check(it.model, [it.poses], poses=held[:3])
    half = quick_check(
        it.model, [it.poses], poses=[replace(pose, frames=pose.frames[::3]) for pose in held[:3]]
    )
    np.testing.assert_allclose(np.diag(whole.shift.covariance), np.diag(half.shift.covariance), rtol=0.05)


def test_names_alone_will_do_and_a_take_may_be_a_pose() -> None:
    it = curved()
    book = own_poses(it.training, it.ranges)
    named = unmeasured(it.poses)
    found = quick_check(it.model, [named], known=book)
    assert all(pose.measured == 0 and pose.by_name == 3 for pose in found.report.poses)
    assert rmse(found.model, it.natural) < 0.4 * rmse(it.model, it.natural)
    measured = quick_check(it.model, [it.poses])
    assert np.diag(found.shift.covariance)[0] > np.diag(measured.shift.covariance)[0]
    held, _ = held_poses(it.poses, it.ranges)
    fist = next(pose for pose in held if pose.name == "fist")
    rows = slice(fist.frames[0], fist.frames[-1] + 1)
    short = replace(
        named,
        name="fist",
        poses=None,
        context={},
        time_s=named.time_s[rows],
        readings=named.readings[rows],
        reference_time_s=np.empty(0),
        reference=np.empty((0, 0)),
    )
    assert [pose.by_name for pose in quick_check(it.model, [short], known=book).report.poses] == [3]


def test_what_no_pose_measured_keeps_the_prior_and_says_so() -> None:
    it = glove(1, "offset")
    take = replace(unmeasured(it.poses, ("I_MCP", "M_MCP")), poses=None)
    found = quick_check(it.model, [take])
    assert found.report.uninformed == ("I_PIP",)
    assert "No pose informs I_PIP" in " ".join(found.report.sentences)
    lane = found.rotations.index("I_PIP")
    assert found.shift.mean[lane] == 0.0
    assert found.shift.covariance[lane, lane] == found.prior.covariance[lane, lane]
    assert [item.is_informed for item in found.report.sensors] == [True, False, True]


def test_a_mistaken_pose_is_left_out_and_named() -> None:
    it = glove(1, "offset")
    book = own_poses(it.training, it.ranges)
    poses = tuple("flat" if name == "fist" else name for name in it.poses.poses or ())
    found = quick_check(it.model, [replace(unmeasured(it.poses), poses=poses)], known=book)
    assert found.report.refused
    assert all("pose flat" in item.pose for item in found.report.refused)
    assert "the hand looks like pose" in found.report.refused[0].reason
    clean = quick_check(it.model, [unmeasured(it.poses)], known=book)
    assert not clean.report.refused
    assert rmse(found.model, it.natural) < 1.5 * rmse(clean.model, it.natural)


def test_a_pose_that_was_not_held_is_named() -> None:
    it = glove(1, "offset")
    wave = 60 * np.sin(2 * np.pi * it.natural.time_s)[:, None]
    moving = replace(unmeasured(it.natural), readings=128 + wave * np.ones(3))
    run = tuple("fist" if 2 < time < 4 else "" for time in moving.time_s)
    mixed = quick_check(it.model, [it.poses, replace(moving, poses=run)])
    assert [item.pose for item in mixed.report.refused] == [f"pose fist at 2.0 s of take {moving.name}"]
    assert "not held still for 0.4 s" in mixed.report.refused[0].reason
    assert "% of its range" in mixed.report.refused[0].reason
    with pytest.raises(BadInput, match="no pose was held still in these takes"):
        quick_check(it.model, [replace(moving, poses=run)])


def test_the_glove_of_the_other_hand_is_refused() -> None:
    it = glove(1, "offset")
    mirrored = replace(it.poses, readings=255.0 - it.poses.readings)
    with pytest.raises(BadInput, match="move the other way than predicted; is this the glove of the other"):
        quick_check(it.model, [mirrored])
    another = replace(it.poses, readings=0.3 * it.poses.readings)
    with pytest.raises(BadInput, match=r"were the poses mistaken, or is this another person"):
        quick_check(it.model, [another])


def test_a_saturated_sensor_tells_nothing() -> None:
    it = glove(1, "offset")
    readings = it.poses.readings.copy()
    readings[:, it.poses.sensors.index("I_PIP")] = 255.0
    found = quick_check(it.model, [replace(it.poses, readings=readings)])
    assert found.report.uninformed == ("I_PIP",)
    assert all(pose.saturated == ("I_PIP",) for pose in found.report.poses)


def test_what_cannot_be_checked_is_refused() -> None:
    it = glove(1, "offset")
    with pytest.raises(BadInput, match="at least one take"):
        quick_check(it.model, [])
    with pytest.raises(BadInput, match="2 wearings"):
        quick_check(it.model, [it.poses, it.training[0]])
    with pytest.raises(BadInput, match="does not say its wearing"):
        quick_check(it.model, [replace(it.poses, wearing="")])
    seen = [take for take in it.training if take.wearing == "wearing-2"]
    for model, trained in ((it.model, ()), (it.plain, ("wearing-1", "wearing-2"))):
        with pytest.raises(BadInput, match="'wearing-2' was in the model's training"):
            quick_check(model, seen, trained_wearings=trained)
    strange = replace(unmeasured(it.poses), poses=("salute",) * len(it.poses.time_s))
    with pytest.raises(BadInput, match=r"the angles of pose 'salute' are not known.*flat, fist, spread"):
        quick_check(it.model, [strange])
