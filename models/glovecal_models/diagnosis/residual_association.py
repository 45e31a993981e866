"""Association of an unexplained error with every recorded column, corrected for multiple testing.

Columns that change within takes are tested by circular shifts of the error, as in ``glovecal where``; those
that change from take to take, and the wearing, by permuting takes. Each shift and permutation is the same for
all columns and joints, which gives the null distribution of the largest (Westfall and Young 1993, single-step
maxT). The two kinds are corrected apart (Bonferroni): the few permutations of takes would be lost among the
many shifts.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from glovecal_models.comparison.dependence import Covariate, ShiftedErrors, covariates
from glovecal_models.comparison.residuals import Residuals, TakeResiduals
from glovecal_models.diagnosis.forward_design import ForwardDesign
from glovecal_models.diagnosis.limits import DiagnosisLimits
from glovecal_models.diagnosis.resampled import ResampledTake
from glovecal_models.diagnosis.slow_error import SecondMeans
from glovecal_models.layout import Layout
from glovecal_models.takes.take import Take

DRAWS = 999
STEPS_AT_MOST = 1000
"""Of a take; what lasts for seconds needs no more."""
MOST = 5
ROUNDING = 1e-6
COLUMNS_AT_ONCE = 16
MOSTLY_WITHIN = 0.5
"""Share of a column's variance inside takes above which it is tested by shifts within takes."""
TAKES_PER_BIN = 3
KINDS = 2


@dataclass(frozen=True)
class ResidualAssociation:
    """A column that an unexplained error of one rotation depends on."""

    rotation: str
    column: str
    """As in ``glovecal where``: "angle", "sensor I_PIP", "context grip_n", "wearing"."""
    phrase: str
    size_deg: float
    """Root mean square that the column explains, beyond its mean under the null hypothesis."""
    p_value: float
    """Corrected for all columns and rotations tested."""


def residual_associations(
    design: ForwardDesign,
    even: Sequence[ResampledTake],
    layout: Layout,
    joints: Sequence[int],
    means: Sequence[Sequence[SecondMeans]],
    generator: np.random.Generator,
) -> tuple[ResidualAssociation, ...]:
    """Up to five columns associated with the errors of ``joints``, the one that explains most first.

    ``even``: the takes of the design, for their readings; ``means``: of all joints.
    """
    shares = generator.random((DRAWS, len(even)))
    permutations = np.array([generator.permutation(len(even)) for _ in range(DRAWS)])
    tried: list[_Tried] = []
    shifted: list[_Shiftable] = []
    for joint in joints:
        rotation, errors = design.rotations[joint], _errors(design, joint, means[joint])
        square = float(np.nanmean(np.concatenate(errors) ** 2))
        for column in _columns(design, even, layout, joint):
            if column.name == "wearing" or not _changes_within_takes(column):
                found = _explained_when_permuted(errors, column, permutations)
                if found is not None:
                    tried.append(_Tried(rotation, column, square, True, found))
            else:
                whole = ShiftedErrors.of(errors, column, STEPS_AT_MOST)
                if whole is not None:
                    shifted.append(_Shiftable(rotation, column, square, whole))
    tried += _tried_with_shifts(shifted, shares, design.limits)
    listed = [
        *_listed([each for each in tried if each.is_permuted], design.limits),
        *_listed([each for each in tried if not each.is_permuted], design.limits),
    ]
    return tuple(sorted(listed, key=lambda item: -item.size_deg)[:MOST])


@dataclass(frozen=True)
class _Tried:
    """One column tested against the error of one rotation."""

    rotation: str
    column: Covariate
    square: float
    """Mean squared error, degrees squared."""
    is_permuted: bool
    explained: np.ndarray
    """(1 + D,), degrees: as it is, then under each draw."""

    @property
    def size_deg(self) -> float:
        """What it explains beyond the mean of the draws."""
        return float(np.sqrt(max(self.explained[0] ** 2 - np.mean(self.explained[1:] ** 2), 0.0)))


@dataclass(frozen=True)
class _Shiftable:
    """One column before it is tested."""

    rotation: str
    column: Covariate
    square: float
    errors: ShiftedErrors

    def tried(self, shares: np.ndarray) -> _Tried:
        found = self.errors.explained_when_shifted(shares)
        return _Tried(self.rotation, self.column, self.square, False, found)


def _tried_with_shifts(
    columns: Sequence[_Shiftable], shares: np.ndarray, limits: DiagnosisLimits
) -> list[_Tried]:
    """All ``columns``; none where it is clear before that none of them would be listed.

    A column that explains too little as it is, is not; and the more columns are tested, the more often the
    largest of all is as large: a p value of some columns is at most that of all.
    """
    least = limits.association_share * (1.0 - ROUNDING)
    matters = [item.errors.explained_deg**2 >= least * item.square for item in columns]
    order = [*np.flatnonzero(matters).tolist(), *np.flatnonzero(np.logical_not(matters)).tolist()]
    tried: dict[int, _Tried] = {}
    for end in (
        sum(matters),
        *range(sum(matters) + COLUMNS_AT_ONCE, len(order), COLUMNS_AT_ONCE),
        len(order),
    ):
        tried |= {at: columns[at].tried(shares) for at in order[len(tried) : end]}
        if not any(_listed(list(tried.values()), limits)):
            return []
    return [tried[at] for at in range(len(columns))]


def _listed(tried: Sequence[_Tried], limits: DiagnosisLimits) -> Iterator[ResidualAssociation]:
    if not tried:
        return
    corrected = _corrected(np.array([item.explained for item in tried]))
    for item, p_value in zip(tried, np.minimum(KINDS * corrected, 1.0), strict=True):
        matters = item.size_deg**2 >= limits.association_share * item.square
        if p_value <= limits.association_p_value and matters:
            yield ResidualAssociation(
                item.rotation, item.column.name, _phrase(item.column), item.size_deg, float(p_value)
            )


def _corrected(explained: np.ndarray) -> np.ndarray:
    """(K,): for each row (1 + D,) the share of draws in which the largest of all rows is as large.

    The two-thirds power makes a mean of squares nearly normal (Wilson and Hilferty 1931), so that rows of
    different freedom can be compared.
    """
    score = explained ** (2 / 3)
    centre, spread = score[:, 1:].mean(axis=1), np.maximum(score[:, 1:].std(axis=1), 1e-12)
    score = (score - centre[:, None]) / spread[:, None]
    largest = score.max(axis=0)
    largest[0] = np.inf
    return np.mean(largest[None, :] >= score[:, :1], axis=1)


def _changes_within_takes(column: Covariate) -> bool:
    known = [values[np.isfinite(values)] for values in column.values]
    known = [values for values in known if len(values)]
    if not known:
        return False
    within = sum(float(np.sum((values - values.mean()) ** 2)) for values in known)
    every = np.concatenate(known)
    return within > MOSTLY_WITHIN * float(np.sum((every - every.mean()) ** 2))


def _explained_when_permuted(
    errors: tuple[np.ndarray, ...], column: Covariate, permutations: np.ndarray
) -> np.ndarray | None:
    """Mean errors of takes in bins of the column's mean, as they are and permuted."""
    if any(not np.isfinite(values).any() for values in column.values):
        return None
    level = np.array([np.nanmean(values) for values in column.values])
    if column.name == "wearing":
        bin_of = np.unique(level, return_inverse=True)[1]
    else:
        edges = np.quantile(level, np.linspace(0, 1, max(2, len(level) // TAKES_PER_BIN) + 1)[1:-1])
        bin_of = np.unique(np.searchsorted(edges, level, side="right"), return_inverse=True)[1]
    bins = int(bin_of.max()) + 1
    if bins < 2 or bins == len(level):
        return None
    known = [values[np.isfinite(values)] for values in errors]
    centre = float(np.concatenate(known).mean())
    total = np.array([np.sum(values - centre) for values in known])
    count = np.array([len(values) for values in known], dtype=float)
    member = np.eye(bins)[bin_of[np.concatenate([np.arange(len(level))[None, :], permutations])]]
    sums, counts = (np.einsum("t,dtb->db", values, member) for values in (total, count))
    return np.sqrt(np.sum(sums**2 / np.maximum(counts, 1.0), axis=1) / count.sum())


def _errors(design: ForwardDesign, joint: int, means: Sequence[SecondMeans]) -> tuple[np.ndarray, ...]:
    """For each take (N,), degrees: sensor minus what the base says, NaN where not fitted or unfamiliar."""
    found = [np.full(len(take.time_s), np.nan) for take in design.signals]
    for (take, rows), residual in zip(design.units(joint), design.products[joint].residual, strict=True):
        found[take][rows] = residual
    for values, take, seconds in zip(found, design.signals, means, strict=True):
        at = np.minimum((take.time_s - take.time_s[:1]).astype(int), len(seconds.weight))
        values[np.append(seconds.weight, 0.0)[at] < design.limits.association_least_weight] = np.nan
    return tuple(found)


def _columns(
    design: ForwardDesign, even: Sequence[ResampledTake], layout: Layout, joint: int
) -> Iterator[Covariate]:
    """Everything but readings that the error may be in itself.

    Those are the joint's own, which hold its noise, and those of other measured joints, which a cause common
    to all sensors shifts alike: of these the angle is taken.
    """
    rotation = design.rotations[joint]
    known = {*layout.correspondence(rotation).sensors, *design.rotations}
    sensors = tuple(name for name in layout.sensors if name not in known)
    takes = []
    for take, signals in zip(even, design.signals, strict=True):
        readings = take.readings[:, [layout.sensors.index(name) for name in sensors]]
        table = Take(
            signals.take, signals.wearing, sensors, signals.time_s, readings, context=signals.context
        )
        takes.append(TakeResiduals(table, signals.own, signals.own, signals.own))
    yield from covariates(Residuals(design.rotations, tuple(takes)), rotation)
    for other, name in enumerate(design.rotations):
        if other != joint:
            angles = tuple(take.own[:, other] for take in design.signals)
            yield Covariate(f"joint {name}", "deg", f"the angle of {name}", angles)
    wearings = list(dict.fromkeys(take.wearing for take in design.signals))
    at = tuple(np.full(len(take), float(wearings.index(take.wearing))) for take in design.signals)
    if len(wearings) > 1:
        yield Covariate("wearing", "", "the wearing", at)


def _phrase(column: Covariate) -> str:
    name = column.name.removeprefix("context ")
    return column.phrase if name == column.name else f"c.{name}"
