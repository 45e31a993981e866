"""Effects that differ from wearing to wearing: an offset and a gain of each joint in each wearing.

Settings hold ``wearings``, the names in the order of the weights (offsets first, then gains, then those of
the curves that wearings of training may have: ``WearingCurves``). A quick check adds a wearing with the
covariance of what its poses told (``checked``), and no curve.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from scipy.linalg import helmert

from glovecal_models.effects.base.dynamics import InstantEffect
from glovecal_models.effects.base.facts import Uncertainty, WeightsOfWearings
from glovecal_models.effects.base.learned_form import OWN, FormTerm, LearnedForm
from glovecal_models.effects.base.signals import Settings, Signals, in_joint_units
from glovecal_models.errors import BadInput

CURVES = "curves"
"""Where the effect's settings keep them; without, offset and gain are all."""
LENGTHSCALES = (0.5, 0.8)
"""In half ranges of the joint."""
SD_DEG = (1.0, 3.0)
PRIOR_CURVES = 2.0
"""So many wearings' worth of belief that a joint's curves are as large as the other joints'."""
PICTURE = np.linspace(-1.0, 1.0, 41)
"""Places in the joint's range over which the size of a curve is told."""


@dataclass(frozen=True)
class WearingCurves:
    """A curve for each of W wearings, a smooth shift along the bend: K functions of each lane's own
    signal.

    A sensor that sits off its joint's axis is shifted in another curve each time. Each is a Gaussian process
    of the joint's own angle in the basis of ``learned_form``. What all wearings share is the regressor's: the
    curves add up to zero over the wearings, so that these have W - 1 weights for each function of the basis.
    """

    wearings: tuple[str, ...]
    """At least two."""
    form: LearnedForm

    @property
    def count(self) -> int:
        """Columns, (W - 1) K."""
        return (len(self.wearings) - 1) * self.form.count

    @cached_property
    def _contrasts(self) -> np.ndarray:
        """(W, W - 1): how much of each weight a wearing has; weights of size one give curves of that size."""
        count = len(self.wearings)
        return helmert(count).T * np.sqrt(count / (count - 1))

    def columns(self, own: np.ndarray, wearing: str) -> np.ndarray:
        """(N, L, C), degrees, of the joints' own signal (N, L); zero in a wearing that has no curve."""
        if wearing not in self.wearings:
            return np.zeros((*own.shape, self.count))
        share = self._contrasts[self.wearings.index(wearing)]
        functions = self.form.columns({OWN: own})
        return (share[:, None] * functions[:, :, None, :]).reshape(*own.shape, self.count)

    def of_wearings(self, weights: np.ndarray) -> np.ndarray:
        """(L, W, K) weights of each wearing's own curve, from ``weights`` (L, C)."""
        return self._contrasts @ weights.reshape(len(weights), -1, self.form.count)

    def from_wearings(self, each: np.ndarray) -> np.ndarray:
        """Inverse of ``of_wearings``: (L, C) from (L, W, K), which add up to zero over wearings."""
        count = len(self.wearings)
        return ((count - 1) / count * self._contrasts.T @ each).reshape(len(each), self.count)

    def size_deg(self, weights: np.ndarray) -> np.ndarray:
        """(L, W): root mean square of each curve over the joint's range, degrees."""
        (low,), (high,) = self.form.low.values(), self.form.high.values()
        places = np.add(low, high) / 2 + PICTURE[:, None] * np.subtract(high, low) / 2
        curves = np.einsum("nlk,lwk->nlw", self.form.columns({OWN: places}), self.of_wearings(weights))
        return np.sqrt(np.mean(curves**2, axis=0))

    def variance(self, own: np.ndarray, weights: np.ndarray) -> np.ndarray:
        """(N, L), degrees squared: of the curve of a wearing without one, from those of training.

        Few wearings tell little of one joint, so each joint leans on all of them, and all on the prior. Zero
        on a joint that has no curves.
        """
        each, size = self.of_wearings(weights), self.form.count
        freedom, has = len(self.wearings) - 1, np.any(weights != 0, axis=1).astype(float)
        square = np.einsum("lwj,lwk->ljk", each, each)
        total = float(np.sum(each**2)) / size
        every = (total + PRIOR_CURVES) / (freedom * has.sum() + PRIOR_CURVES)
        spread = (square + PRIOR_CURVES * every * np.eye(size)) / (freedom + PRIOR_CURVES)
        spread *= (has * (1 + 1 / len(self.wearings)))[:, None, None]
        functions = self.form.columns({OWN: own})
        return np.einsum("nlj,ljk,nlk->nl", functions, spread, functions)

    def to_document(self) -> dict[str, Any]:
        """Plain data, as it stands in an effect's settings."""
        return {"wearings": list(self.wearings), "form": self.form.to_document()}

    @classmethod
    def of_settings(cls, settings: Settings) -> WearingCurves | None:
        """None where they have none. Raises BadInput."""
        document = settings.get(CURVES)
        if document is None:
            return None
        try:
            form = document["form"]
            terms = tuple((float(term["lengthscale"]), float(term["sd_deg"])) for term in form["terms"])
            ends = (tuple(map(float, form[end][OWN])) for end in ("low", "high"))
            return _curves(tuple(document["wearings"]), terms, *ends)
        except (KeyError, TypeError, ValueError) as error:
            raise BadInput("not the curves of wearings: something in it is missing, or no number") from error


@lru_cache(maxsize=64)
def _curves(
    wearings: tuple[str, ...],
    terms: tuple[tuple[float, float], ...],
    low: tuple[float, ...],
    high: tuple[float, ...],
) -> WearingCurves:
    """Live frames ask for the same ones again and again."""
    if len(wearings) < 2:
        raise BadInput(f"curves are of two wearings or more, not {len(wearings)}")
    form = LearnedForm(tuple(FormTerm((OWN,), *term) for term in terms), {OWN: low}, {OWN: high})
    return WearingCurves(wearings, LearnedForm.from_document(form.to_document()))


def joined_curves(
    parts: Sequence[tuple[WearingCurves, Mapping[int, int], np.ndarray]], lanes: int
) -> tuple[WearingCurves, np.ndarray] | None:
    """The curves of effects on different joints as those of one on ``lanes`` joints, with weights (lanes, C).

    Each of ``parts`` has the places of its own joints among them and its weights (L, C). None without a part.
    """
    if not parts:
        return None
    wearings = tuple(dict.fromkeys(name for curves, _, _ in parts for name in curves.wearings))
    terms = tuple(dict.fromkeys(term for curves, _, _ in parts for term in curves.form.terms))
    low, high = np.zeros((2, lanes))
    each = np.zeros((lanes, len(wearings), sum(term.count for term in terms)))
    starts = dict(zip(terms, np.cumsum([0, *(term.count for term in terms)]), strict=False))
    for curves, places, weights in parts:
        own, whole = list(places), list(places.values())
        low[whole] = np.array(curves.form.low[OWN])[own]
        high[whole] = np.array(curves.form.high[OWN])[own]
        columns = [starts[term] + number for term in curves.form.terms for number in range(term.count)]
        names = [wearings.index(name) for name in curves.wearings]
        each[np.ix_(whole, names, columns)] = curves.of_wearings(weights)[own]
    ends = ({OWN: tuple(map(float, end))} for end in (low, high))
    joined = WearingCurves(wearings, LearnedForm(terms, *ends))
    return joined, joined.from_wearings(each)


def possible_curves(takes: Sequence[Signals], wearings: Sequence[str]) -> list[Mapping[str, Any]]:
    """Documents of those that training may choose from; none with less than two wearings."""
    if len(wearings) < 2:
        return []
    return [
        curves_over([FormTerm((OWN,), lengthscale, sd)], takes, wearings)
        for lengthscale in LENGTHSCALES
        for sd in SD_DEG
    ]


def curves_over(
    terms: Sequence[FormTerm], takes: Sequence[Signals], wearings: Sequence[str]
) -> Mapping[str, Any]:
    """The document of curves of ``wearings``, two at least, in the range of ``takes``."""
    form = LearnedForm.over(terms, [{OWN: take.own} for take in takes])
    return WearingCurves(tuple(wearings), form).to_document()


PRIOR_DEG = 3.5
"""Expected standard deviation of offsets, and of gains for one standard deviation of the joint."""
PRIOR_WEARINGS = 2.0
"""So many wearings' worth of belief that a joint's shifts are as large as the other joints'."""


class WearingEffect(InstantEffect):
    """What is common to such effects; the columns are to be implemented."""


class WeightsOfShifts(WeightsOfWearings):
    """An offset, a gain and perhaps a curve for each wearing of an effect's settings."""

    def __init__(self, settings: Settings) -> None:
        self._settings = settings
        self.are_trained: bool = bool(trained_wearings(settings))

    def unknown(self, wearing: str) -> str | None:
        if self.knows(wearing):
            return None
        return f"wearing {wearing!r} was not in training" if wearing else "nobody said which wearing this is"

    def knows(self, wearing: str) -> bool:
        return wearing in self._settings["wearings"]

    def uncertainty(self, weights: np.ndarray, wearing: str) -> Uncertainty | None:
        settings = self._settings
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
