"""Errors of fingertips in mm: geometry that is known in closed form, what counts, and the floor."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest

from glovecal_models.comparison.compare import summed_up
from glovecal_models.comparison.fingertips import TIPS, fingertip_errors, hand_poses, tips_mm
from glovecal_models.comparison.floor_estimate import NoiseFloor
from glovecal_models.comparison.residuals import Residuals, TakeResiduals
from glovecal_models.hand.dimensions import HandDimensions
from glovecal_models.hand.rotations import ARCHING_ROTATIONS, HAND_ROTATIONS, completed
from glovecal_models.hand.skeleton import hand_skeleton
from glovecal_models.simulation.protocol import random_posture
from glovecal_models.simulation.simulated_hand import DRIVEN
from glovecal_models.takes.take import Take

HAND = HandDimensions.from_measured({"hand_length": 190})
TOUCH = {
    "T_TMC": 43.0, "TI_ABD": 36.2, "T_VIR": 39.5, "T_MCP": 25.4, "T_IP": 32.8,
    "IM_ABD": 10.2, "I_MCP": 50.7, "I_PIP": 57.1, "I_DIP": 38.3,
}  # fmt: skip
"""Thumb and index finger touch, within 1 mm."""
FLAT = dict.fromkeys(HAND_ROTATIONS, 0.0)


def chord(length: float, angle_deg: float) -> float:
    return 2 * length * np.sin(np.radians(angle_deg) / 2)


def reach(finger: str, *segments: str) -> float:
    return sum(HAND.sizes_mm[f"{finger}_{segment}"] for segment in segments)


def item(
    measured: Mapping[str, np.ndarray], predicted: Mapping[str, np.ndarray], rotations: tuple[str, ...]
) -> TakeResiduals:
    """A take measured in ``measured``, of a model that predicts ``rotations``."""
    count = len(next(iter(measured.values())))
    time = np.arange(count) / 60
    reference = np.column_stack([np.asarray(values, float) for values in measured.values()])
    take = Take(
        name="one", wearing="monday", sensors=("A",), time_s=time, readings=np.zeros((count, 1)),
        rotations=tuple(measured), reference_time_s=time, reference=reference,
    )  # fmt: skip
    angles = np.column_stack([np.asarray(predicted[name], float) for name in rotations])
    return TakeResiduals(take, angles, np.ones_like(angles), take.reference_at_frames(rotations))


def still(count: int = 3, **angles: float) -> dict[str, np.ndarray]:
    """The flat hand but for ``angles``."""
    return {name: np.full(count, value) for name, value in {**FLAT, **angles}.items()}


def test_touching_is_what_it_says() -> None:
    angles = np.array([list({**FLAT, **TOUCH}.values())])
    thumb, index = tips_mm(hand_skeleton(HAND), angles)[0, :2]
    assert np.linalg.norm(thumb - index) < 1.0


def found(measured, predicted, rotations=HAND_ROTATIONS) -> Residuals:
    return Residuals(rotations, (item(measured, predicted, rotations),))


def moving(count: int, seed: int = 0) -> dict[str, np.ndarray]:
    """Postures of a hand."""
    random = np.random.default_rng(seed)
    postures = np.array([random_posture(random) for _ in range(count)])
    return dict(zip(HAND_ROTATIONS, completed(DRIVEN, postures).T, strict=True))


@pytest.mark.parametrize(
    ("rotation", "finger", "length"),
    [
        ("I_DIP", "index", reach("I", "distal")),
        ("M_PIP", "middle", reach("M", "middle", "distal")),
        ("R_MCP", "ring", reach("R", "proximal", "middle", "distal")),
        ("RP_ABD", "pinky", reach("P", "proximal", "middle", "distal")),
        ("T_MCP", "thumb", reach("T", "proximal", "distal")),
    ],
)
def test_one_wrong_joint_moves_its_tip_along_a_circle(rotation: str, finger: str, length: float) -> None:
    errors = fingertip_errors(found(still(), {**still(), rotation: np.full(3, 7.0)}), {}, HAND)
    assert errors is not None
    for name in TIPS:
        expected = chord(length, 7.0) if name == finger else 0.0
        assert errors.fingers[name].rmse_mm == pytest.approx(expected, abs=1e-9)
    assert errors.overall.rmse_mm == pytest.approx(chord(length, 7.0) / np.sqrt(5))
    assert errors.overall.count == 15
    assert (errors.worst.finger, errors.worst.take) == (finger, "one")
    assert errors.overall.assumed_equal == ()


def test_the_wrist_does_not_count() -> None:
    errors = fingertip_errors(found(still(), still(W_FLEX=30.0, W_ABD=10.0)), {}, HAND)
    assert errors is not None
    assert errors.overall.rmse_mm == 0.0


def test_what_was_not_measured_is_taken_equal_and_named() -> None:
    measured, predicted = still(), still(I_DIP=20.0, T_VIR=9.0, I_PIP=5.0)
    for name in ("I_DIP", "T_VIR"):
        measured[name] = np.full(3, np.nan)
    errors = fingertip_errors(found(measured, predicted), {}, HAND)
    assert errors is not None
    assert errors.fingers["thumb"].rmse_mm == 0.0
    assert errors.fingers["thumb"].assumed_equal == ("T_VIR",)
    assert errors.fingers["index"].assumed_equal == ("I_DIP",)
    straight = fingertip_errors(found(still(I_DIP=20.0), still(I_DIP=20.0, I_PIP=5.0)), {}, HAND)
    assert straight is not None
    assert errors.fingers["index"].rmse_mm == pytest.approx(straight.fingers["index"].rmse_mm)
    assert "T_VIR and I_DIP were not measured throughout and assumed equal." in errors.sentence


def test_only_fingers_count_whose_chain_was_predicted_and_measured() -> None:
    everything = still()
    rotations = ("T_MCP", "T_IP", "I_MCP", "I_PIP", "M_MCP", "R_MCP", "R_PIP")
    measured = {name: everything[name].copy() for name in (*rotations, "P_MCP", "P_PIP")}
    measured["R_PIP"][:2] = np.nan
    errors = fingertip_errors(found(measured, everything, rotations), {}, HAND)
    assert errors is not None
    assert {name: one.count for name, one in errors.fingers.items()} == {"index": 3, "ring": 1}
    assert errors.thumb_index is None
    assert errors.fingers["index"].assumed_equal == ("I_DIP", "IM_ABD")
    assert fingertip_errors(found(measured, everything, ("T_MCP", "I_MCP")), {}, HAND) is None


def test_hands_are_equal_wherever_they_are_not_compared() -> None:
    measured, predicted = moving(40), moving(40, seed=1)
    measured["M_MCP"][::2] = np.nan
    del measured["T_VIR"]
    poses = hand_poses(found(measured, predicted))
    assert poses is not None
    differ = poses.predicted != poses.measured
    assert not (differ & ~poses.compared).any()
    np.testing.assert_array_equal(poses.predicted[:, HAND_ROTATIONS.index("T_VIR")], predicted["T_VIR"])
    assert poses.counts[::2, 2].sum() == 0
    assert poses.counts[1::2, 2].all()


def test_predictions_that_are_no_number_and_takes_without_frames_do_not_count() -> None:
    measured, predicted = still(), still()
    predicted["I_MCP"][0] = np.inf
    predicted["T_VIR"][:], measured["T_VIR"][:] = -np.inf, np.nan
    empty = item({name: np.empty(0) for name in FLAT}, {name: np.empty(0) for name in FLAT}, HAND_ROTATIONS)
    both = Residuals(HAND_ROTATIONS, (empty, item(measured, predicted, HAND_ROTATIONS)))
    errors = fingertip_errors(both, {}, HAND)
    assert errors is not None
    assert {name: one.count for name, one in errors.fingers.items()} == {**dict.fromkeys(TIPS, 3), "index": 2}
    assert errors.overall.rmse_mm == 0.0


def test_errors_grow_with_the_hand() -> None:
    residuals = found(moving(50), moving(50, seed=1))
    small, large = (
        fingertip_errors(residuals, {}, HandDimensions.from_measured({"hand_length": length}))
        for length in (100, 200)
    )
    assert small is not None
    assert large is not None
    assert small.thumb_index is not None
    assert large.thumb_index is not None
    assert large.overall.rmse_mm == pytest.approx(2 * small.overall.rmse_mm)
    assert large.thumb_index.percentile_95_mm == pytest.approx(2 * small.thumb_index.percentile_95_mm)
    assert small.overall.percentile_95_mm > small.overall.rmse_mm > 0


@pytest.mark.parametrize("touching", [False, True], ids=["apart", "touching"])
def test_noise_alone_is_at_the_floor(touching: bool) -> None:
    """Joints that err by nothing but their floors give tips at theirs; touching tips can only move apart."""
    measured = moving(3000)
    if touching:
        measured = {**still(3000), **{name: np.full(3000, angle) for name, angle in TOUCH.items()}}
    random = np.random.default_rng(4)
    sizes = {name: random.uniform(0.3, 1.5) for name in HAND_ROTATIONS}
    predicted = {name: values + sizes[name] * random.normal(size=3000) for name, values in measured.items()}
    floors = {
        name: NoiseFloor(size, 0.9 * size, 1.2 * size, 0.0, "still hand", 9) for name, size in sizes.items()
    }
    errors = fingertip_errors(found(measured, predicted), floors, HAND)
    assert errors is not None
    assert errors.thumb_index is not None
    for one in (*errors.fingers.values(), errors.overall, errors.thumb_index):
        assert one.floor is not None
        assert one.rmse_mm == pytest.approx(one.floor.floor_mm, rel=0.06)
        assert not one.floor.is_lower_bound
    assert errors.overall.floor is not None
    assert errors.overall.floor.low_mm == pytest.approx(0.9 * errors.overall.floor.floor_mm, rel=0.06)
    assert errors.overall.floor.high_mm == errors.overall.rmse_mm, "a floor is never above its error"


def test_a_floor_is_unknown_or_a_lower_bound_when_that_of_a_joint_is() -> None:
    sure = NoiseFloor(1.0, 0.9, 1.1, 0.5, "still hand", 9)
    least = NoiseFloor(1.0, 0.9, 1.1, 0.5, "spectrum", 9)
    floors = {**dict.fromkeys(HAND_ROTATIONS, sure), "I_DIP": least, "P_MCP": None}
    errors = fingertip_errors(found(moving(20), moving(20, seed=1)), floors, HAND)
    assert errors is not None
    assert errors.fingers["pinky"].floor is None
    assert errors.overall.floor is None
    assert errors.fingers["index"].floor is not None
    assert errors.fingers["index"].floor.is_lower_bound
    assert errors.fingers["middle"].floor is not None
    assert not errors.fingers["middle"].floor.is_lower_bound


def test_the_sentence_says_whether_the_hand_was_measured() -> None:
    residuals = found(moving(200), moving(200, seed=1))
    assumed = summed_up(residuals).fingertips
    assert assumed is not None
    assert (assumed.hand_length_mm, assumed.is_assumed) == (190.0, True)
    assert "(RMSE, for a hand of 190 mm, an assumed size; noise floor" in assumed.sentence
    assert set(assumed.fingers) == set(TIPS)
    known = summed_up(residuals, dimensions=HAND).fingertips
    assert known is not None
    assert not known.is_assumed
    assert "(RMSE, for a hand of 190 mm; noise floor" in known.sentence
    other = found({"A": np.zeros(5)}, {"A": np.ones(5)}, ("A",))
    assert summed_up(other).fingertips is None


def test_an_arch_that_was_measured_moves_the_little_finger_only() -> None:
    arched, flat = still(PALM_ARCH=20.0), still(PALM_ARCH=0.0)
    errors = fingertip_errors(found(arched, flat, ARCHING_ROTATIONS), {}, HAND)
    assert errors is not None
    hand = hand_skeleton(HAND, palm="arching")
    angles = np.array([[*FLAT.values(), arch] for arch in (20.0, 0.0)])
    apart = np.linalg.norm(np.subtract(*tips_mm(hand, angles)), axis=1)
    assert errors.fingers["pinky"].rmse_mm == pytest.approx(apart[4])
    assert errors.fingers["ring"].rmse_mm == pytest.approx(0.0)
    assert errors.worst.finger == "pinky"
    assert errors.worst.measured_deg["PALM_ARCH"] == 20.0
    only_predicted = fingertip_errors(found(still(), flat, ARCHING_ROTATIONS), {}, HAND)
    assert only_predicted is not None
    assert "PALM_ARCH" not in only_predicted.worst.measured_deg
