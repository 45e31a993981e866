"""IK samples of a simulated subject: nearer to the truth than the calibration; refused where no touch was."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from ik_samples import IkSamples, ik_samples

from glovecal_models.calibration.added_effect import AddedEffect
from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.samples import gather_samples
from glovecal_models.calibration.training import train
from glovecal_models.calibration.training_settings import TrainingSettings
from glovecal_models.effects.sensor_fault.fault_watch import FaultLimits
from glovecal_models.errors import BadInput, LayoutMismatch
from glovecal_models.hand.dimensions import HandDimensions
from glovecal_models.hand.rotations import FINGERS, HAND_ROTATIONS
from glovecal_models.hand.skeleton import hand_skeleton
from glovecal_models.sampling.inverse_kinematics.contact import Rod, TipChains, Touch
from glovecal_models.sampling.inverse_kinematics.follow import RULE_SD_DEG, follow, predicted_hand
from glovecal_models.simulation.protocol import evaluation_segment, key_pose_segment, sampling_protocol
from glovecal_models.simulation.simulated_glove import SimulatedGlove, SimulatedTake, simulate_take
from glovecal_models.simulation.touching import touching_segment
from glovecal_models.takes.take import Take

SEED = 2
GLOVE = SimulatedGlove(SEED)
HAND = hand_skeleton(HandDimensions.from_measured({"hand_length": 182}))
SMALL = TrainingSettings(method="lmc_gpr", samples=120, folds=0)
LINEAR = TrainingSettings(method="linear", folds=0)
FRAMES, RATE_HZ = 176, 60.0


def fk_take() -> Take:
    """What IK sampling begins with; nobody measured the joints without a sensor."""
    take = simulate_take(GLOVE, sampling_protocol(SEED), seed=SEED, rate_hz=30).take
    measured = [name for name in take.rotations if not name.endswith(("DIP", "VIR"))]
    columns = [take.rotations.index(name) for name in measured]
    return replace(take, rotations=tuple(measured), reference=take.reference[:, columns])


def touching(finger: str, seed: int = 11, rate_hz: float = RATE_HZ) -> SimulatedTake:
    segment = touching_segment(GLOVE.hand, HAND, finger, seed, FRAMES / RATE_HZ)
    return simulate_take(GLOVE, segment, seed=seed, rate_hz=rate_hz)


@pytest.fixture(scope="module")
def model() -> CalibrationModel:
    return train([fk_take()], GLOVE.layout, "anna", SMALL)


@pytest.fixture(scope="module")
def taken() -> dict[str, SimulatedTake]:
    return {finger: touching(finger) for finger in "IMRP"}


def truth_of(samples: IkSamples, taken: SimulatedTake) -> np.ndarray:
    columns = [GLOVE.rotations.index(name) for name in samples.rotations]
    return taken.truth[samples.frames][:, columns]


def rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))


@pytest.mark.parametrize("finger", list("IMRP"))
def test_176_frames_touch_within_limits_smoothly_and_nearer_to_the_truth(model, taken, finger: str) -> None:
    samples = ik_samples(taken[finger].take, model, HAND, Touch(("T", finger)))
    chains = TipChains(HAND, ("T", finger))
    assert samples.rotations == chains.rotations
    assert len(samples.frames) >= 0.95 * FRAMES
    tips = chains.tips_mm(samples.angles_deg)
    assert np.linalg.norm(tips[:, 0] - tips[:, 1], axis=1).max() < 0.1
    assert (samples.angles_deg >= chains.limits_deg[:, 0]).all()
    assert (samples.angles_deg <= chains.limits_deg[:, 1]).all()
    assert np.abs(np.diff(samples.angles_deg, axis=0)).max() < 5.0
    truth = truth_of(samples, taken[finger])
    before = predicted_hand(taken[finger].take, model).mean_deg[samples.frames][:, chains.columns]
    assert rms(samples.angles_deg - truth) < 0.85 * rms(before - truth)


@pytest.mark.parametrize("finger", list("IMRP"))
def test_what_samples_claim_to_know_is_true(model, taken, finger: str) -> None:
    """Errors are as large as claimed, and smaller where the touch tells more."""
    samples = ik_samples(taken[finger].take, model, HAND, Touch(("T", finger)))
    wrong = (samples.angles_deg - truth_of(samples, taken[finger])) / samples.sd_deg
    assert 0.3 < rms(wrong) < 2.0
    assert ((samples.told >= 0) & (samples.told <= 1)).all()
    np.testing.assert_allclose(samples.told.sum(axis=1), 3.0, atol=1e-6)  # a touch is three equations
    assert f"{len(samples.frames)} samples of {len(samples.rotations)} rotations" in samples.sentence
    assert "mm off (median)" in samples.sentence


def test_samples_train_like_any_take(model, taken) -> None:
    samples = ik_samples(taken["R"].take, model, HAND, Touch(("T", "R")))
    found = gather_samples([samples.take], GLOVE.layout.correspondence("R_PIP"))
    np.testing.assert_array_equal(found.target, samples.angles_deg[:, samples.rotations.index("R_PIP")])
    np.testing.assert_array_equal(
        found.inputs[:, 0], samples.readings[:, samples.take.sensors.index("R_PIP")]
    )


def test_touches_after_four_key_poses_bring_the_tips_together() -> None:
    """The paper's claim for IK sampling, from the least that can come before it."""
    poses = simulate_take(GLOVE, key_pose_segment(SEED), seed=SEED, rate_hz=30).take
    first = train([poses], GLOVE.layout, "anna", LINEAR)
    chains, touch = TipChains(HAND, ("T", "R")), Touch(("T", "R"))
    takes = [ik_samples(touching("R", seed).take, first, HAND, touch).take for seed in (11, 12)]
    second, other = train([poses, *takes], GLOVE.layout, "anna", SMALL), touching("R", 40).take

    def apart_mm(model: CalibrationModel) -> float:
        tips = chains.tips_mm(predicted_hand(other, model).mean_deg[:, chains.columns])
        return float(np.linalg.norm(tips[:, 0] - tips[:, 1], axis=1).mean())

    assert apart_mm(first) > 15
    assert apart_mm(second) < 6


def test_a_pre_roll_gives_no_samples(model, taken) -> None:
    take = replace(taken["M"].take, begins_s=float(taken["M"].take.time_s[60]))
    samples = ik_samples(take, model, HAND, Touch(("T", "M")))
    assert samples.frames.min() >= 60
    assert np.isnan(samples.take.reference[:60]).all()
    assert samples.take.begins_s == take.begins_s


def test_a_failing_sensor_of_the_chain_gives_no_samples(model, taken) -> None:
    """The model knows what each sensor can do; here one of index and one of ring finger drop out."""
    sensors, rotations = GLOVE.layout.sensors, model.rotation_names
    limits = FaultLimits(
        sensors=sensors,
        lag_s=(0.02, 0.1, 0.5),
        surprise_counts=((25.0, 35.0, 80.0),) * len(sensors),
        still_s=(1e3,) * len(sensors),
        rotations=rotations,
        move_lag_s=(0.02, 0.1, 1.0),
        move_deg=((0.5, 5.0, 30.0),) * len(rotations),
        reads=tuple(GLOVE.layout.correspondence(name).sensors[:1] for name in rotations),
    )
    settings = {"where": ["I_PIP"], "live": limits.to_settings()}
    nothing = np.zeros((len(rotations), 0))
    fault = AddedEffect("sensor_fault", rotations, settings, nothing, nothing, np.zeros(len(rotations)))
    watching = replace(
        model,
        effects=(fault,),
        sensor_centre=np.full(len(sensors), 120.0),
        sensor_scale=np.full(len(sensors), 50.0),
    )
    take = taken["I"].take
    readings = take.readings.copy()
    readings[50:56, sensors.index("I_PIP")] = 1.0
    readings[100:106, sensors.index("R_PIP")] = 1.0
    samples = ik_samples(replace(take, readings=readings), watching, HAND, Touch(("T", "I")))
    assert not set(range(50, 56)) & set(samples.frames.tolist())
    assert set(range(100, 106)) <= set(samples.frames.tolist())
    assert len(samples.frames) > 0.9 * FRAMES
    assert "of 176 frames do not fit a touch, or a sensor fails, and are left out" in samples.sentence


@pytest.mark.parametrize("length", [20.0, 45.0])
def test_a_rod_held_between_two_tips_is_sampled_too(model, length: float) -> None:
    chains = TipChains(HAND, ("T", "I"))
    true = follow(chains, Rod(("T", "I"), length), predicted_hand(touching("I").take, model).shape(chains))
    whole = predicted_hand(touching("I").take, model).mean_deg.copy()
    whole[:, chains.columns] = true.angles_deg
    columns = [HAND_ROTATIONS.index(name) for name in GLOVE.rotations if name != "PALM_ARCH"]
    angles = np.insert(whole[:, columns], GLOVE.rotations.index("PALM_ARCH"), 4.0, axis=1)
    take = replace(touching("I").take, readings=GLOVE.readings(angles, np.random.default_rng(3)))
    samples = ik_samples(take, model, HAND, Rod(("T", "I"), length))
    tips = chains.tips_mm(samples.angles_deg)
    np.testing.assert_allclose(np.linalg.norm(tips[:, 0] - tips[:, 1], axis=1), length, atol=0.1)
    np.testing.assert_allclose(samples.told.sum(axis=1), 1.0, atol=1e-6)
    with pytest.raises(BadInput, match="a rod of 120 mm between thumb and index cannot be seen"):
        ik_samples(take, model, HAND, Rod(("T", "I"), 120.0))


@pytest.mark.parametrize(("did", "said"), [("M", "I"), ("I", "M"), ("P", "R"), ("I", "P")])
def test_the_wrong_finger_is_told(model, did: str, said: str) -> None:
    with pytest.raises(BadInput, match=f"For the {FINGERS[did]} it is .* times: was that the finger"):
        ik_samples(touching(did, rate_hz=12).take, model, HAND, Touch(("T", said)))


@pytest.mark.parametrize("finger", list("IP"))
def test_a_touch_that_never_happened_is_refused(model, finger: str) -> None:
    take = simulate_take(GLOVE, evaluation_segment(3), seed=3, rate_hz=4).take
    with pytest.raises(BadInput, match=f"a touch of thumb and {FINGERS[finger]} cannot be seen in this take"):
        ik_samples(take, model, HAND, Touch(("T", finger)))


def test_a_hand_that_cannot_touch_is_refused_with_what_is_missing(model, taken) -> None:
    sizes = {"hand_length": 182, "hand_breadth": 140, "T_metacarpal": 24, "T_proximal": 19, "T_distal": 15}
    wide = hand_skeleton(HandDimensions.from_measured(sizes))
    with pytest.raises(
        BadInput,
        match=r"thumb and pinky is impossible for this hand: at best 15\.6 mm are missing, with T_TMC at its "
        r"limit of 60 degrees.*P_PIP at its limit of 100 degrees.*hand length 182 mm; measured: hand_length",
    ):
        ik_samples(taken["P"].take, model, wide, Touch(("T", "P")))


def test_dimensions_of_somebody_else_are_refused(model) -> None:
    long_thumb = {"hand_length": 182, "T_metacarpal": 80, "T_proximal": 62, "T_distal": 50}
    skeleton = hand_skeleton(HandDimensions.from_measured(long_thumb))
    with pytest.raises(BadInput, match="check the hand's dimensions"):
        ik_samples(touching("I", rate_hz=12).take, model, skeleton, Touch(("T", "I")))


def test_another_glove_is_refused(model, taken) -> None:
    take = taken["I"].take
    with pytest.raises(LayoutMismatch, match="has no sensor 'T_TMC'"):
        ik_samples(
            replace(take, sensors=take.sensors[1:], readings=take.readings[:, 1:]),
            model,
            HAND,
            Touch(("T", "I")),
        )


def test_joints_that_nobody_calibrated_are_as_unsure_as_their_rule(model, taken) -> None:
    hand = predicted_hand(taken["I"].take, model)
    by_name = dict(zip(HAND_ROTATIONS, hand.sd_deg.T, strict=True))
    np.testing.assert_allclose(by_name["I_DIP"], np.hypot(2 / 3 * by_name["I_PIP"], RULE_SD_DEG))
    assert (by_name["T_VIR"] > RULE_SD_DEG).all()
    assert not hand.is_faulty.any()
