"""What is known of the tracker's errors from rendered hands with a truth: Q, P, and honest deviations.

A posterior covariance alone claims too much: neighbouring pixels err together, the hand is not quite the
model's, and a fit may sit in the wrong valley. So each degree of freedom's standard deviation is

    exp(a + b log(posterior) + c log(share of disagreeing pixels))

with a, b, c of largest likelihood on errors of other hands than the model's, for each stage, alone and
followed from picture to picture.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from glovecal_models.colour_glove.hand_state import DEGREES_OF_FREEDOM
from glovecal_models.colour_glove.pose_estimate import STAGES
from glovecal_models.documents import UNREADABLE_ARCHIVE
from glovecal_models.errors import BadInput
from glovecal_models.names import did_you_mean

_LEAST_DISAGREEING = 0.02
_RANGE = {"angles": (0.3, 60.0), "turn": (0.2, 90.0), "position": (0.2, 300.0)}
"""Of a stated deviation, degrees, degrees, mm: what learning saw ends there."""
_LOW, _HIGH = (
    np.array([_RANGE["angles"][end]] * 20 + [_RANGE["turn"][end]] * 3 + [_RANGE["position"][end]] * 3)
    for end in (0, 1)
)


@dataclass(frozen=True, eq=False)
class LearnedErrors:
    blend_covariance: np.ndarray
    """Q, (26, 26): of true states about blended neighbours, in steps of ``HandState.moved``."""
    speed: np.ndarray
    """P, (26,): how fast a hand departs from where it was, degrees and mm a second, root mean square."""
    scales: Mapping[str, np.ndarray]
    """(26, 3): a, b, c, by "stage" and "stage-followed"."""

    @classmethod
    def as_posterior(cls, blend_covariance: np.ndarray, speed: np.ndarray) -> LearnedErrors:
        """Before anything was learned: each stage's posterior deviations stand as they are."""
        plain = np.tile([0.0, 1.0, 0.0], (DEGREES_OF_FREEDOM, 1))
        names = [scale_name(stage, followed) for stage in STAGES for followed in (False, True)]
        return cls(blend_covariance, speed, dict.fromkeys(names, plain))

    def deviation(
        self, stage: str, followed: bool, posterior_sd: np.ndarray, disagreeing: float
    ) -> np.ndarray:
        """(26,) standard deviations. Raises BadInput for a stage of which nothing was learned."""
        name = scale_name(stage, followed)
        if name not in self.scales:
            meant = did_you_mean(name, self.scales, there="known are")
            raise BadInput(f"errors of {name!r} were never learned; {meant}")
        features = error_features(posterior_sd[None], np.array([disagreeing]))[0]
        return np.clip(np.exp((self.scales[name] * features).sum(axis=1)), _LOW, _HIGH)

    def save(self, file: Path) -> None:
        arrays = {"blend_covariance": self.blend_covariance, "speed": self.speed}
        arrays |= {f"scale:{name}": values for name, values in self.scales.items()}
        with file.open("wb") as stream:
            np.savez(stream, allow_pickle=False, **arrays)

    @classmethod
    def load(cls, file: Path) -> LearnedErrors:
        """Raises BadInput for a file that holds something else."""
        try:
            with file.open("rb") as stream, np.load(stream, allow_pickle=False) as held:
                arrays = {name: held[name] for name in held.files}
            scales = {n.removeprefix("scale:"): v for n, v in arrays.items() if n.startswith("scale:")}
            found = cls(arrays["blend_covariance"], arrays["speed"], scales)
        except UNREADABLE_ARCHIVE as error:
            raise BadInput(
                f"{file.name} holds no errors of the colour glove's tracker that can be read; remove it, and "
                "it is made again"
            ) from error
        shapes = [found.blend_covariance.shape, found.speed.shape, *(v.shape for v in scales.values())]
        expected = [
            (DEGREES_OF_FREEDOM,) * 2,
            (DEGREES_OF_FREEDOM,),
            *[(DEGREES_OF_FREEDOM, 3)] * len(scales),
        ]
        if shapes != expected or not all(np.isfinite(array).all() for array in arrays.values()):
            raise BadInput(f"{file.name} holds arrays of shapes {shapes}, expected {expected}, all finite")
        return found


def scale_name(stage: str, followed: bool) -> str:
    return f"{stage}-followed" if followed else stage


def error_features(posterior_sd: np.ndarray, disagreeing: np.ndarray) -> np.ndarray:
    """(N, 26, 3) of posteriors (N, 26) and shares (N,)."""
    found = np.ones((*posterior_sd.shape, 3))
    found[..., 1] = np.log(posterior_sd)
    found[..., 2] = np.log(disagreeing + _LEAST_DISAGREEING)[:, None]
    return found


def fitted_scale(errors: np.ndarray, posterior_sd: np.ndarray, disagreeing: np.ndarray) -> np.ndarray:
    """(26, 3): a, b, c of largest Gaussian likelihood, by Newton's method; b is drawn to 1 and c to 0.

    ``errors`` (N, 26). Raises BadInput for fewer frames than tell anything.
    """
    if len(errors) < 30:
        raise BadInput(f"{len(errors)} frames to learn errors from; at least 30 are needed")
    features = error_features(posterior_sd, disagreeing)
    found = np.empty((DEGREES_OF_FREEDOM, 3))
    drawn_to, pull = np.array([0.0, 1.0, 0.0]), np.diag([0.0, 20.0, 20.0])
    for column in range(DEGREES_OF_FREEDOM):
        rows, squares = features[:, column], errors[:, column] ** 2
        centre = np.log(np.sqrt(squares.mean()) + 1e-9) - (rows[:, 1]).mean()
        scale = np.array([centre, 1.0, 0.0])
        for _ in range(60):
            ratio = squares * np.exp(-2.0 * np.clip(rows @ scale, -20.0, 20.0))
            slope = rows.T @ (1.0 - ratio) + pull @ (scale - drawn_to)
            curve = (rows * (2.0 * ratio)[:, None]).T @ rows + pull + 1e-6 * np.eye(3)
            step = np.clip(np.linalg.solve(curve, slope), -0.5, 0.5)
            scale = scale - step
            if np.abs(step).max() < 1e-6:
                break
        found[column] = scale
    return found
