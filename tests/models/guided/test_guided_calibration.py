"""From a whole simulated sampling to a calibration: what touches add, what is refused, one kind alone."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from asked_session import RECORDING, asked_session

from glovecal_models.calibration.artifact import dump, load
from glovecal_models.calibration.methods import Method
from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.predictor import BY_RULE, GlovePredictor
from glovecal_models.calibration.training import train
from glovecal_models.calibration.training_settings import TrainingSettings
from glovecal_models.errors import Cancelled, LayoutMismatch, NotTrainable
from glovecal_models.hand.dimensions import HandDimensions
from glovecal_models.hand.rotations import HAND_ROTATIONS
from glovecal_models.hand.skeleton import hand_skeleton
from glovecal_models.layout import Layout
from glovecal_models.sampling.catalogue import make_protocol
from glovecal_models.sampling.guided.guided_calibration import (
    GuidedCalibration,
    guided_calibration,
    guided_samples,
)
from glovecal_models.sampling.guided.labelled_takes import LabelledTake
from glovecal_models.sampling.inverse_kinematics.contact import Rod, TipChains, Touch
from glovecal_models.sampling.inverse_kinematics.follow import predicted_hand
from glovecal_models.sampling.protocol import Protocol
from glovecal_models.sampling.sampled_takes import sampled_takes
from glovecal_models.simulation.protocol import evaluation_segment
from glovecal_models.simulation.simulated_glove import SimulatedGlove, simulate_take
from glovecal_models.simulation.touching import touching_segment

SEED, RATE_HZ = 2, 30.0
LAYOUT = Layout.built_in("cyberglove18")
GLOVE = SimulatedGlove(SEED)
HAND = hand_skeleton(HandDimensions.from_measured({"hand_length": 182}))
SMALL = TrainingSettings(samples=250, folds=0)
PARTS = ("loosen", "verification-start", "key-poses-1", "key-poses-2", "T_TMC", "TI_ABD", "T_MCP", "T_IP")
TAUGHT = ("T_TMC", "TI_ABD", "T_VIR", "T_MCP", "T_IP", "I_MCP", "I_PIP", "I_DIP", "M_MCP", "M_PIP", "M_DIP")


@cache
def sampled() -> tuple[LabelledTake, ...]:
    """Poses, the thumb's widgets, touches of index and middle finger, a rod."""
    steps = make_protocol("new_subject", LAYOUT).steps
    wanted = tuple(s for s in steps if s.part in PARTS or s.name in ("touch-I", "touch-M", "rod-I-60"))
    session = asked_session(
        Protocol("some", wanted), GLOVE, seed=SEED, rate_hz=RATE_HZ, skeleton=HAND, at_once_s=0.2
    )
    cut = sampled_takes(session.state, {RECORDING: session.take}, name="s")
    return tuple(LabelledTake.of(each) for each in cut)


@cache
def calibrated(kinds: str = "all", method: Method = "lmc_gpr") -> GuidedCalibration:
    wanted: dict[str, Callable[[LabelledTake], bool]] = {
        "all": lambda each: True,
        "fk": lambda each: not each.contacts,
        "ik": lambda each: not each.take.rotations,
    }
    takes = [each for each in sampled() if wanted[kinds](each)]
    return guided_calibration(takes, LAYOUT, "anna", HAND, replace(SMALL, method=method))


@cache
def touching(finger: str):
    motion = touching_segment(GLOVE.hand, HAND, finger, 70, 2.0)
    return simulate_take(GLOVE, motion, seed=70, rate_hz=RATE_HZ)


def apart_mm(model: CalibrationModel, finger: str) -> float:
    chains = TipChains(HAND, ("T", finger))
    tips = chains.tips_mm(predicted_hand(touching(finger).take, model).mean_deg[:, chains.columns])
    return float(np.linalg.norm(tips[:, 0] - tips[:, 1], axis=1).mean())


def pose_errors(model: CalibrationModel, rotations: tuple[str, ...]) -> dict[str, float]:
    """Mean absolute error in the nine poses, by rotation."""
    test = simulate_take(GLOVE, evaluation_segment(7), seed=7, rate_hz=20)
    hand = predicted_hand(test.take, model).mean_deg
    found = {name: hand[:, HAND_ROTATIONS.index(name)] for name in rotations}
    truth = {name: test.truth[:, GLOVE.rotations.index(name)] for name in rotations}
    return {name: float(np.abs(found[name] - truth[name]).mean()) for name in rotations}


def test_touches_bring_tips_together_in_another_touching_motion() -> None:
    """A single frame has the noise of ten sensors: 2 to 3 mm."""
    for finger in "IM":
        assert apart_mm(calibrated().model, finger) < 3.6
        assert apart_mm(calibrated().model, finger) < 0.75 * apart_mm(calibrated("fk").model, finger)


def test_touches_bring_angles_nearer_to_the_truth() -> None:
    before, after = (pose_errors(calibrated(kinds).model, TAUGHT) for kinds in ("fk", "all"))
    assert np.mean(list(after.values())) < 0.85 * np.mean(list(before.values()))
    assert max(after.values()) < 3.0


def test_held_poses_alone_teach_a_process_no_worse_than_a_line() -> None:
    """Seventy frames of one hold are one sample: trained on frames, LMC-GPR bent through every hold."""
    bends = tuple(f"{finger}_{joint}" for finger in "IMRP" for joint in ("MCP", "PIP"))
    takes = [each.take for each in sampled() if each.take.rotations]
    few = replace(LAYOUT, correspondences=tuple(c for c in LAYOUT.correspondences if c.rotation in bends))
    line, frames = (
        np.mean(list(pose_errors(train(takes, few, "anna", replace(SMALL, method=method)), bends).values()))
        for method in ("linear", "lmc_gpr")
    )
    guided = np.mean(list(pose_errors(calibrated("fk").model, bends).values()))
    assert guided < 1.1 * line
    assert guided < 0.9 * frames


def test_samples_are_counted_by_rotation_and_kind() -> None:
    counts = {(item.rotation, item.kind): item for item in calibrated().samples}
    assert counts["I_MCP", "fk_independent"].samples > 100
    assert counts["I_MCP", "ik"].samples == counts["I_PIP", "ik"].samples
    assert 0.3 < (counts["T_VIR", "ik"].told or 0) <= 1
    assert counts["T_IP", "fk_cross_couple"].told is None
    assert ("T_VIR", "fk_cross_couple") not in counts
    assert all((item.told or 1) >= 0.05 for item in counts.values())
    told = " ".join(calibrated().sentences)
    assert "poses were held" in told
    assert "Tips of thumb and index: read" in told
    assert "Tips of thumb and index at the rod" in told


def test_fk_only_needs_no_hand_and_leaves_the_rest_to_rules() -> None:
    takes = [each for each in sampled() if not each.contacts]
    model = guided_calibration(takes, LAYOUT, "anna", None, SMALL).model
    assert model.layout == LAYOUT
    angles = GlovePredictor(model).predict(np.full((1, len(LAYOUT.sensors)), 100.0))
    by_rule = {
        name for name, flag in zip(model.rotation_names, angles.flags[0], strict=True) if flag & BY_RULE
    }
    assert by_rule == {"T_VIR", "I_DIP", "M_DIP", "R_DIP", "P_DIP"}


def test_ik_only_brings_tips_together_from_nothing_but_ranges() -> None:
    found = calibrated("ik")
    assert {item.kind for item in found.samples} == {"ik"}
    assert "W_FLEX" not in found.model.rotation_names
    for finger in "IM":
        assert apart_mm(found.model, finger) < 5.0


def test_what_the_model_claims_is_what_it_is_off_by() -> None:
    test = simulate_take(GLOVE, evaluation_segment(9), seed=9, rate_hz=20)
    predictor = GlovePredictor(calibrated().model)
    angles = predictor.predict(test.take.readings)
    columns = [predictor.rotations.index(name) for name in TAUGHT]
    truth = test.truth[:, [GLOVE.rotations.index(name) for name in TAUGHT]]
    wrong = (angles.mean[:, columns] - truth) / angles.sd[:, columns]
    assert 0.5 < float(np.sqrt(np.mean(wrong**2))) < 1.5


def test_a_touch_that_never_happened_is_refused_and_the_rest_goes_on() -> None:
    """The take says little finger, it was the middle one."""
    asked = [
        replace(each, contacts={**each.contacts, "touch-M": Touch(("T", "P"))})
        if "touch-M" in each.contacts
        else each
        for each in sampled()
    ]
    found = guided_samples(asked, LAYOUT, HAND)
    assert [each.pose for each in found.refused] == ["touch-M"]
    assert "cannot be seen in this take" in found.refused[0].reason
    assert any(said.startswith("Left out: touch-M") for said in found.sentences)
    assert any("Tips of thumb and index: read" in said for said in found.sentences)


def test_touches_that_the_hand_forbids_are_refused_and_the_rest_goes_on() -> None:
    longer = [
        replace(each, contacts=dict.fromkeys(each.contacts, Rod(("T", "I"), 200.0))) for each in sampled()
    ]
    found = guided_samples(longer, LAYOUT, HAND)
    assert len(found.refused) == 3
    assert "a rod of 200 mm between thumb and index" in found.refused[0].reason
    assert {item.kind for item in found.samples} == {"fk_independent", "fk_cross_couple"}


def test_an_impossible_touch_alone_teaches_nothing() -> None:
    sizes = {"hand_length": 182, "hand_breadth": 140, "T_metacarpal": 24, "T_proximal": 19, "T_distal": 15}
    wide = hand_skeleton(HandDimensions.from_measured(sizes))
    little = [
        replace(each, contacts={"touch-I": Touch(("T", "P"))})
        for each in sampled()
        if "touch-I" in each.contacts
    ]
    with pytest.raises(
        NotTrainable, match=r"every touch was refused \(touch-I: .* is impossible for this hand"
    ):
        guided_samples(little, LAYOUT, wide)


def test_dimensions_of_somebody_else_are_refused() -> None:
    sizes = {"hand_length": 182, "T_metacarpal": 80, "T_proximal": 62, "T_distal": 50}
    some = [each for each in sampled() if each.take.rotations or "touch-I" in each.contacts]
    one = [
        replace(each, contacts={p: c for p, c in each.contacts.items() if p == "touch-I"}) for each in some
    ]
    found = guided_samples(one, LAYOUT, hand_skeleton(HandDimensions.from_measured(sizes)))
    assert found.refused
    assert all("check the hand's dimensions" in each.reason for each in found.refused)


@pytest.mark.parametrize("method", ["raw", "linear"])
def test_baselines_take_known_angles_as_they_are(method: Method) -> None:
    found = calibrated("all", method)
    takes = [each.take for each in sampled() if each.take.rotations]
    same = train(takes, LAYOUT, "anna", replace(SMALL, method=method))
    assert dump(found.model) == dump(same)
    assert "no touches" in found.sentences[0]
    ik = [each for each in sampled() if each.contacts]
    with pytest.raises(NotTrainable, match="needs poses or widgets"):
        guided_calibration(ik, LAYOUT, "anna", HAND, replace(SMALL, method=method))


def test_the_model_can_be_kept_and_says_how_far_it_is() -> None:
    said: list[tuple[str, float]] = []
    takes = [each for each in sampled() if not each.contacts]
    found = guided_calibration(
        takes, LAYOUT, "anna", HAND, SMALL, take_hashes=("a",), report=lambda s, f: said.append((s, f))
    )
    assert found.model.simulated
    assert found.model.takes == ("a",)
    assert dump(load(dump(found.model))) == dump(found.model)
    shares = [share for _, share in said]
    assert shares == sorted(shares)
    assert shares[-1] == 1.0
    with pytest.raises(Cancelled):
        guided_calibration(takes, LAYOUT, "anna", HAND, SMALL, cancelled=lambda: True)


def test_what_cannot_teach_is_told() -> None:
    with pytest.raises(NotTrainable, match="no pose, no widget and no touch"):
        guided_samples([each for each in sampled() if each.kind == "range"], LAYOUT, HAND)
    with pytest.raises(NotTrainable, match="need the subject's hand dimensions"):
        guided_samples([each for each in sampled() if each.contacts], LAYOUT, None)
    first = sampled()[0]
    other = replace(first.take, sensors=first.take.sensors[1:], readings=first.take.readings[:, 1:])
    with pytest.raises(LayoutMismatch):
        guided_samples([replace(first, take=other)], LAYOUT, HAND)
