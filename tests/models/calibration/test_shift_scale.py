"""The scale of a wearing's shift, from its poses; the prior's where they are silent."""

from __future__ import annotations

import numpy as np
import pytest

from glovecal_models.quick_check.wearing_shift import (
    SCALE_SD,
    SCALES,
    PoseError,
    WearingShift,
    scaled_to_poses,
)

LANES, POSES = 12, 4
PRIOR = WearingShift(np.zeros(2 * LANES), np.diag(np.repeat([9.0, 1.0], LANES)))
POSE_SD = 2.5


def witnesses(scale: float, seed: int) -> tuple[np.ndarray, list[PoseError]]:
    """A shift (2 L,), ``scale`` times as large as the prior's, and poses in which it is seen."""
    random = np.random.default_rng(seed)
    shift = scale * np.sqrt(np.diag(PRIOR.covariance)) * random.standard_normal(2 * LANES)
    made = []
    for _ in range(POSES):
        joint = random.normal(0, 1, LANES)
        error = shift[:LANES] + joint * shift[LANES:] + POSE_SD * random.standard_normal(LANES)
        made.append(PoseError(error, joint, np.full(LANES, POSE_SD**2)))
    return shift, made


def scale_of(shift: WearingShift) -> float:
    return float(np.sqrt(shift.covariance[0, 0] / PRIOR.covariance[0, 0]))


@pytest.mark.parametrize("scale", [0.1, 1.0, 2.0])
def test_the_scale_is_found(scale: float) -> None:
    found = [scale_of(scaled_to_poses(PRIOR, witnesses(scale, seed)[1])) for seed in range(20)]
    assert max(scale / 1.5, 0.05) <= np.median(found) <= max(1.5 * scale, 0.35)


def test_it_is_the_likeliest_of_its_scales() -> None:
    _, poses = witnesses(0.6, 3)
    rows = np.concatenate([PRIOR.rows(np.arange(LANES), pose.joint) for pose in poses])
    error = np.concatenate([pose.error for pose in poses])

    def log_probability(scale: float) -> float:
        spread = scale**2 * rows @ PRIOR.covariance @ rows.T + POSE_SD**2 * np.eye(len(error))
        hyper = -0.5 * (np.log(scale) / SCALE_SD) ** 2
        fit = error @ np.linalg.inv(spread) @ error
        return float(-0.5 * (np.linalg.slogdet(spread).logabsdet + fit)) + hyper

    best = max(SCALES.tolist(), key=log_probability)
    assert scale_of(scaled_to_poses(PRIOR, poses)) == pytest.approx(best)


def test_a_glove_that_hardly_shifts_is_not_corrected_by_its_poses_own_errors() -> None:
    def left(prior_for) -> float:
        squares = []
        for seed in range(20):
            shift, poses = witnesses(0.15, seed)
            after = prior_for(poses).after(poses)
            squares.append(np.mean((after.mean - shift)[:LANES] ** 2))
        return float(np.sqrt(np.mean(squares)))

    untouched = 0.15 * 3.0
    assert left(lambda poses: PRIOR) > 2 * untouched
    assert left(lambda poses: scaled_to_poses(PRIOR, poses)) < 1.4 * untouched


def test_without_a_known_angle_the_prior_stays() -> None:
    silent = PoseError(np.full(LANES, np.nan), np.zeros(LANES), np.ones(LANES))
    for poses in ([], [silent]):
        np.testing.assert_array_equal(scaled_to_poses(PRIOR, poses).covariance, PRIOR.covariance)
