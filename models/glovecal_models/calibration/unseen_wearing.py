"""What a model is off by in a wearing that its training did not see, beyond what its regressors claim.

Each wearing is left out whole and predicted from the others. What its squared errors have beyond the claimed
variance is one draw, for each rotation, of the variance between wearings. Few wearings tell little of one
rotation, so each leans on all rotations of the glove and all lean on ``PRIOR_DEG``, as a donning shift's do
(effects/base/wearing_effect.py): a scaled inverse chi-squared distribution for the variance. An error in the
next wearing then follows a Student t, and the claimed standard deviation is the half-width that holds 68.27 %
of it: with two wearings a fifth more than a normal distribution's.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np
from scipy.special import chdtri, ndtr, stdtrit

from glovecal_models.effects.base.wearing_effect import PRIOR_DEG, PRIOR_WEARINGS

INTERVAL_LEVEL = 0.95
"""Of the interval of the error."""
MUCH_WORSE = 1.5
"""Times the error in wearings seen: from here on the difference is of the wearing, not of chance in takes."""


@dataclass(frozen=True)
class LeftOutWearing:
    """Errors of one rotation in a wearing that was left out whole."""

    rotation: str
    wearing: str
    trained_wearings: int
    """On so many the model was trained that predicted it."""
    square: float
    """Sum of squared errors, degrees squared."""
    count: int
    claimed: float
    """Mean variance claimed for these errors, degrees squared."""
    noise: float
    """Measurement noise of the regressor that predicted them, degrees squared."""

    @property
    def between(self) -> float:
        """What the mean squared error has beyond the claim, for one wearing; negative where it has less."""
        excess = self.square / self.count - self.claimed
        return excess / (1 + 1 / self.trained_wearings)


@dataclass(frozen=True)
class UnseenWearing:
    """Which wearings a model has seen, and how far to trust it in another. Degrees."""

    wearings: tuple[str, ...]
    """Of the training takes."""
    rmse_deg: float | None = None
    """Overall, each wearing left out whole; None: one wearing only, or not estimated."""
    interval_deg: tuple[float, float] | None = None
    """95 % interval of the RMSE in one more wearing."""
    per_rotation: Mapping[str, float] = field(default_factory=dict)
    """RMSE by rotation."""
    per_wearing: Mapping[str, float] = field(default_factory=dict)
    """RMSE in each wearing, left out."""
    between_sd_deg: Mapping[str, float] = field(default_factory=dict)
    """Standard deviation between wearings, by rotation."""
    freedom: float = 0.0
    """Degrees of freedom of these, by which the t distribution is chosen."""
    added_variance: Mapping[str, float] = field(default_factory=dict)
    """Degrees squared by rotation, added to the claimed variance in a wearing that was not seen."""
    left_out: tuple[LeftOutWearing, ...] = ()
    """What all this was estimated from."""

    def is_seen(self, wearing: str) -> bool:
        return wearing in self.wearings

    def is_much_worse_than(self, seen_deg: float | None) -> bool:
        """Whether the error in the next wearing is another one than ``seen_deg``, in wearings seen."""
        return self.rmse_deg is not None and seen_deg is not None and self.rmse_deg > MUCH_WORSE * seen_deg

    def to_document(self) -> dict[str, Any]:
        """Plain JSON-able data."""
        document = asdict(self)
        return {
            **document,
            "wearings": list(self.wearings),
            "left_out": [asdict(each) for each in self.left_out],
        }

    @classmethod
    def from_document(cls, document: Mapping[str, Any] | None) -> UnseenWearing | None:
        """Inverse of ``to_document``; None for a model of before. Raises KeyError, TypeError, ValueError."""
        if document is None:
            return None
        low_high = document["interval_deg"]
        rmse = document["rmse_deg"]
        return cls(
            tuple(str(name) for name in document["wearings"]),
            None if rmse is None else float(rmse),
            None if low_high is None else (float(low_high[0]), float(low_high[1])),
            **{
                name: {str(key): float(value) for key, value in document[name].items()}
                for name in ("per_rotation", "per_wearing", "between_sd_deg", "added_variance")
            },
            freedom=float(document["freedom"]),
            left_out=tuple(LeftOutWearing(**item) for item in document["left_out"]),
        )


def unseen_wearing(
    wearings: Sequence[str], left_out: Sequence[LeftOutWearing], noise: Mapping[str, float]
) -> UnseenWearing:
    """Of a model trained on ``wearings`` whose regressors claim ``noise`` (degrees squared, by rotation).

    ``left_out``: none where nothing could be left out; the wearings seen are known all the same.
    """
    names = tuple(dict.fromkeys(wearings))
    left_out = [item for item in left_out if item.count and item.rotation in noise]
    if not left_out:
        return UnseenWearing(names)
    rotations = list(dict.fromkeys(item.rotation for item in left_out))
    own = {name: [item for item in left_out if item.rotation == name] for name in rotations}
    seen = max(len(items) for items in own.values())
    spread = between_variance(own)
    freedom = seen - 1 + PRIOR_WEARINGS
    quantile = stdtrit(freedom, ndtr(1.0))
    added = {}
    for name, variance in spread.items():
        within = float(np.mean([item.noise for item in own[name]]))
        # Trained on all wearings at once a regressor's noise holds part of their differences already.
        total = within + variance * (1 + 1 / len(names)) * quantile**2
        added[name] = max(total - noise[name], 0.0)
    rmse = _rmse(left_out)
    low, high = (chdtri(freedom, 1.0 - p) for p in ((1 - INTERVAL_LEVEL) / 2, (1 + INTERVAL_LEVEL) / 2))
    return UnseenWearing(
        names,
        rmse,
        (float(rmse * np.sqrt(freedom / high)), float(rmse * np.sqrt(freedom / low))),
        {name: _rmse(items) for name, items in own.items()},
        {
            name: _rmse([item for item in left_out if item.wearing == name])
            for name in dict.fromkeys(item.wearing for item in left_out)
        },
        {name: float(np.sqrt(variance)) for name, variance in spread.items()},
        float(freedom),
        added,
        tuple(left_out),
    )


def between_variance(own: Mapping[str, Sequence[LeftOutWearing]]) -> dict[str, float]:
    """Degrees squared by rotation, from the wearings left out of each."""
    freedom = {name: max(len(items) - 1, 1) for name, items in own.items()}
    sums = {
        name: freedom[name] * max(float(np.mean([item.between for item in items])), 0.0)
        for name, items in own.items()
    }
    pooled = (sum(sums.values()) + PRIOR_WEARINGS * PRIOR_DEG**2) / (sum(freedom.values()) + PRIOR_WEARINGS)
    return {name: (sums[name] + PRIOR_WEARINGS * pooled) / (freedom[name] + PRIOR_WEARINGS) for name in own}


def _rmse(items: Sequence[LeftOutWearing]) -> float:
    return float(np.sqrt(sum(item.square for item in items) / sum(item.count for item in items)))
