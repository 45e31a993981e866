"""Effects that differ from wearing to wearing: an offset and a gain of each joint in each wearing.

Settings hold ``wearings``, the names in the order of the weights (offsets first, then gains, then those of
the curves that wearings of training may have: ``wearing_curves``). A quick check adds a wearing with the
covariance of what its poses told (``checked``), and no curve.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import ClassVar

import numpy as np

from glovecal_models.effects.base.effect import InstantEffect, Uncertainty
from glovecal_models.effects.base.facts import Settings
from glovecal_models.effects.base.joint_units import in_joint_units
from glovecal_models.effects.base.wearing_curves import WearingCurves

PRIOR_DEG = 3.5
"""Expected standard deviation of offsets, and of gains for one standard deviation of the joint."""
PRIOR_WEARINGS = 2.0
"""So many wearings' worth of belief that a joint's shifts are as large as the other joints'."""


class WearingEffect(InstantEffect):
    """What is common to such effects; the columns are to be implemented."""

    tells_own_uncertainty: ClassVar[bool] = True

    def is_of_training(self, settings: Settings) -> bool:
        return bool(trained_wearings(settings))

    def unavailable_inputs(self, settings: Settings, context: Collection[str], wearing: str) -> str | None:
        if wearing in settings["wearings"]:
            return None
        return f"wearing {wearing!r} was not in training" if wearing else "nobody said which wearing this is"

    def knows_wearing(self, settings: Settings, wearing: str) -> bool:
        return wearing in settings["wearings"]

    def uncertainty(self, settings: Settings, weights: np.ndarray, wearing: str) -> Uncertainty | None:
        covariance = shift_covariance(settings, weights, wearing)
        if covariance is None:
            return None
        offset, both, gain = covariance[:, 0, 0], covariance[:, 0, 1], covariance[:, 1, 1]
        curves = WearingCurves.of_settings(settings)

        def variance(own: np.ndarray) -> np.ndarray:
            joint = in_joint_units(own, settings)
            shift = offset + 2 * joint * both + joint**2 * gain
            return shift if curves is None else shift + curves.variance(own, curve_weights(settings, weights))

        return variance


def shift_covariance(settings: Settings, weights: np.ndarray, wearing: str) -> np.ndarray | None:
    """(L, 2, 2), degrees squared: how uncertain offset and gain of a wearing are, ``weights`` (L, C).

    None for a wearing of training, whose many frames leave no doubt worth mentioning.
    """
    checked = settings.get("checked", {})
    if wearing in checked:
        return np.array(checked[wearing])
    if wearing in settings["wearings"]:
        return None
    return learned_spread(settings, weights)[:, :, None] ** 2 * np.eye(2)


def curve_weights(settings: Settings, weights: np.ndarray) -> np.ndarray:
    """Those of the curves, last of ``weights`` (L, C)."""
    return weights[:, 2 * len(settings["wearings"]) :]


def trained_wearings(settings: Settings) -> list[str]:
    """The wearings whose shifts were learned from training takes, not from a quick check."""
    return [name for name in settings["wearings"] if name not in settings.get("checked", {})]


def learned_spread(settings: Settings, weights: np.ndarray) -> np.ndarray:
    """(L, 2): standard deviation of a new wearing's offset and gain, degrees, from the wearings of training.

    Few wearings tell little of one joint, so each joint leans on all of them, and all on ``PRIOR_DEG``.
    Where a quick check started from another prior, it is kept beside the check.
    """
    if "prior_sd_deg" in settings:
        return np.array(settings["prior_sd_deg"])
    wearings = settings["wearings"]
    trained = np.array([wearings.index(name) for name in trained_wearings(settings)])
    square = np.empty((len(weights), 2))
    for kind in range(2):
        values = weights[:, kind * len(wearings) + trained]
        freedom = max(len(trained) - 1, 0)
        own = values.var(axis=1) * len(trained)
        every = (own.sum() + PRIOR_WEARINGS * PRIOR_DEG**2) / (freedom * len(own) + PRIOR_WEARINGS)
        square[:, kind] = (own + PRIOR_WEARINGS * every) / (freedom + PRIOR_WEARINGS)
    # The regressor stands for the mean of the wearings seen, which is itself uncertain.
    return np.sqrt(square * (1 + 1 / max(len(trained), 1)))


def with_checked_wearing(
    settings: Settings, weights: np.ndarray, wearing: str, shift: np.ndarray, covariance: np.ndarray
) -> tuple[Settings, np.ndarray]:
    """Settings and weights (L, C) with one more wearing, known by a quick check: ``shift`` (L, 2) is its
    offset and gain, degrees, ``covariance`` (L, 2, 2). A check of the same wearing before is replaced."""
    wearings = list(settings["wearings"])
    offsets, gains = np.split(weights[:, : 2 * len(wearings)], 2, axis=1)
    if wearing in wearings:
        at = wearings.index(wearing)
        offsets, gains = np.delete(offsets, at, axis=1), np.delete(gains, at, axis=1)
        wearings.remove(wearing)
    checked = settings.get("checked", {}) | {wearing: covariance.tolist()}
    curves = curve_weights(settings, weights)
    found = np.column_stack([offsets, shift[:, 0], gains, shift[:, 1], curves])
    return {**settings, "wearings": [*wearings, wearing], "checked": checked}, found
