"""How much one effect explains, joint by joint, beside its control, with the p value."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property

import numpy as np

from glovecal_models.effects.base.column_steps import ColumnSteps
from glovecal_models.effects.base.facts import BETWEEN_TAKES, Certainty
from glovecal_models.effects.base.limits import SIGNIFICANCE_LIMITS, SignificanceLimits

BLOCK_ROWS = 125
"""5 s of the rows that are fitted."""
MOST_EXACT_RANKS = 25
"""Values up to which signed ranks have their exact p value."""


def saved_share(before: np.ndarray, after: np.ndarray) -> float:
    """Share of the squared errors ``before`` that is gone ``after``; 0 where there was no error to save."""
    whole = float(before.sum())
    return 1.0 - float(after.sum()) / whole if whole > 0 else 0.0


@dataclass(frozen=True)
class JointErrors:
    """Held-out squared errors of one joint in each block of time."""

    base: np.ndarray
    """(B,), degrees squared, without the effect."""
    added: np.ndarray
    """(B,), with it."""
    control: np.ndarray
    """(B,), with its control."""
    rows: int
    take: np.ndarray
    """(B,), the take each block lies in."""

    @property
    def saved(self) -> float:
        return saved_share(self.base, self.added)

    @property
    def control_saved(self) -> float:
        return saved_share(self.base, self.control)

    @property
    def contrast(self) -> float:
        """Share of the squared error saved beyond what the control saves."""
        return self.saved - max(self.control_saved, 0.0)

    @property
    def contrast_of_several(self) -> float:
        """``contrast`` without the take that saves most, which may be unlike all others; of one take or two
        as it is."""
        takes = np.unique(self.take)
        if len(takes) < 3:
            return self.contrast
        saved = self.saved_in_takes
        rest = self.take != takes[int(np.argmax(saved))]
        base = self.base[rest]
        return saved_share(base, self.added[rest]) - max(saved_share(base, self.control[rest]), 0.0)

    @property
    def saved_in_takes(self) -> np.ndarray:
        """(T,): ``beyond_control``, summed over the blocks of each take."""
        saved = self.beyond_control
        return np.array([saved[self.take == take].sum() for take in np.unique(self.take)])

    @property
    def beyond_control(self) -> np.ndarray:
        """(B,): what each block saves against the better of base and control."""
        return (self.base if self.control_saved <= 0 else self.control) - self.added


@dataclass(frozen=True)
class HeldOutRmse:
    """Degrees."""

    before: float
    """Without the effect."""
    after: float
    """With it."""
    control: float
    """With its control instead."""


@dataclass(frozen=True)
class Assessment:
    """One effect on all joints."""

    effect: str
    joints: tuple[str, ...]
    errors: tuple[JointErrors, ...]
    shapes: tuple[np.ndarray, ...]
    """(P,) best shape of each joint."""
    weights: tuple[np.ndarray, ...]
    """(C,) of each joint."""
    p_value: float | None = None
    """Of a session effect, by permuting takes; None: tested block by block."""
    numbers: tuple[str, ...] = ()
    """Names of the shape's numbers, units included."""
    certainty: Certainty = BETWEEN_TAKES
    """Limits of ``p_value``."""
    limits: SignificanceLimits = SIGNIFICANCE_LIMITS
    known_saved_square: tuple[float, ...] = ()
    """Squared degrees per row that the effects of the model save on each joint; empty where it has none."""
    within_camera: tuple[int, ...] = ()
    """Joints on which what it saves may as well be an error of the camera that measured the angles."""
    within_slip: tuple[int, ...] = ()
    """Joints whose slow error, beside the model's effects, is no larger than that of a healthy glove, which
    slips a little: what changes from take to take is nothing else there."""
    still: tuple[int, ...] = ()
    """Joints that hardly move: nothing is told of them."""
    of_known: tuple[int, ...] = ()
    """Joints on which the memory is of what the model's effects add there, not of the joint's own motion."""
    part_of: str = ""
    """An effect of the model that it seems to explain a part of; empty: none."""
    steps: ColumnSteps | None = None
    """In which it acts; None: smoothly."""

    def shape_described(self, joint: int) -> dict[str, float]:
        """The shape of one joint by its numbers' names."""
        return dict(zip(self.numbers, map(float, self.shapes[joint]), strict=False))

    @cached_property
    def significant_joints(self) -> tuple[int, ...]:
        """Joints on which the effect beats its control significantly, saves more than the effects of the
        model may have left there, and is not the camera's; none where it seems to explain a part of one."""
        if self.part_of:
            return ()
        not_its_own = (*self.within_camera, *self.within_slip, *self.still)
        mine = (i for i in self._beyond_control if i not in not_its_own)
        return tuple(i for i in mine if not self._is_within_known(i))

    @cached_property
    def within_known(self) -> tuple[int, ...]:
        """Joints on which it beats its control, but saves no more than the model's effects may have left."""
        return () if self.part_of else tuple(i for i in self._beyond_control if self._is_within_known(i))

    def _is_within_known(self, joint: int) -> bool:
        if joint in self.of_known:
            return True
        if not self.known_saved_square:
            return False
        item = self.errors[joint]
        if item.contrast >= self.limits.beside_known_rest_share:
            return False
        saved = float(item.base.sum() - item.added.sum()) / max(item.rows, 1)
        return saved < self.limits.beside_known_share * self.known_saved_square[joint]

    @cached_property
    def _beyond_control(self) -> tuple[int, ...]:
        if self.p_value is not None:
            return self._significant_in_session(self.p_value)
        joint_p_value = self.limits.joint_p_value / max(1, len(self.errors) / 5)
        some = {i for i, item in enumerate(self.errors) if self._is_alone_beyond_chance(item, joint_p_value)}
        together = [i for i, item in enumerate(self.errors) if item.contrast >= 0.5 * self.limits.least_share]
        if len(together) > 1 and self._is_beyond_chance(
            pooled_errors(self.errors), self.limits.pooled_p_value
        ):
            some.update(together)
        return tuple(sorted(some))

    def _is_alone_beyond_chance(self, errors: JointErrors, p_value: float) -> bool:
        """Whether one joint shows it without the others: in its takes too, the blocks of one go together."""
        limits = self.limits
        if errors.contrast < limits.alone_share:
            return False
        takes = errors.saved_in_takes
        is_faint = len(takes) >= limits.few_takes and errors.contrast < limits.clear_share
        in_takes = signed_rank(takes) if is_faint else 0.0
        return in_takes <= limits.alone_takes_p_value and self._is_beyond_chance(errors, p_value)

    def _is_beyond_chance(self, errors: JointErrors, p_value: float) -> bool:
        limits = self.limits
        if errors.contrast < limits.least_share:
            return False
        rare_p_value = limits.rare_p_value
        if self._has_few_takes and not self._is_large_throughout(errors, p_value):
            p_value, rare_p_value = (min(each, limits.few_takes_p_value) for each in (p_value, rare_p_value))
        if signed_rank(errors.beyond_control, limits.fewest_blocks) <= p_value:
            return True
        is_large = errors.contrast >= limits.rare_share
        return is_large and random_signs(errors.beyond_control, limits.fewest_blocks) <= rare_p_value

    def _is_large_throughout(self, errors: JointErrors, p_value: float) -> bool:
        """In more takes than one and, by sum as by rank, not in a few blocks."""
        is_large = errors.contrast_of_several >= self.limits.few_takes_large_share
        return is_large and random_signs(errors.beyond_control, self.limits.fewest_blocks) <= p_value

    def _significant_in_session(self, p_value: float) -> tuple[int, ...]:
        limits = self.limits
        largest = max((item.contrast for item in self.errors), default=0.0)
        is_alone = largest < limits.alone_clear_share and self._contrast_of_all < limits.together_share
        # what a model's effects leave of themselves in a few takes may go along with a wearing by chance
        is_clear = largest >= limits.clear_share and not is_alone and not any(self.known_saved_square)
        most = self.certainty.clear if is_clear else self.certainty.faint
        most = min(most, limits.alone_session_p_value) if is_alone else most
        if p_value > (min(most, self.certainty.of_few_takes) if self._has_few_takes else most):
            return ()
        least = self.limits.least_session_share
        some = [i for i, item in enumerate(self.errors) if item.contrast >= least]
        if not self._has_few_takes:
            return tuple(some)
        several = [item.contrast_of_several for item in self.errors]
        if max(several, default=0.0) < self.limits.few_takes_large_share:
            return ()
        return tuple(i for i in some if several[i] >= 0.5 * least)

    @property
    def _contrast_of_all(self) -> float:
        return pooled_errors(self.errors).contrast if self.errors else 0.0

    @cached_property
    def _has_few_takes(self) -> bool:
        takes = np.unique(np.concatenate([item.take for item in self.errors])) if self.errors else ()
        return self.certainty.of_few_takes < 1.0 and len(takes) < self.limits.few_takes

    @property
    def as_of_many_takes(self) -> Assessment:
        """The same, judged as where there are many takes: also what one joint alone shows."""
        limits = replace(
            self.limits,
            alone_share=self.limits.least_share,
            alone_takes_p_value=1.0,
            alone_clear_share=0.0,
        )
        return replace(self, certainty=replace(self.certainty, of_few_takes=1.0), limits=limits)

    @property
    def saved_square(self) -> float:
        """Squared degrees that the effect saves on its significant joints, per row, summed over joints."""
        return float(
            sum(
                (self.errors[i].base.sum() - self.errors[i].added.sum()) / self.errors[i].rows
                for i in self.significant_joints
            )
        )

    @property
    def rmse_deg(self) -> HeldOutRmse:
        """Over the significant joints, or over all when there are none."""
        joints = self.significant_joints or tuple(range(len(self.errors)))
        rows = max(sum(self.errors[i].rows for i in joints), 1)
        parts = [
            sum(getattr(self.errors[i], name).sum() for i in joints) for name in ("base", "added", "control")
        ]
        before, after, control = (float(np.sqrt(max(part, 0.0) / rows)) for part in parts)
        return HeldOutRmse(before, after, control)

    @property
    def largest_contrast_joint(self) -> str:
        """Where it saves most beyond its control."""
        return self.joints[max(range(len(self.errors)), key=lambda i: self.errors[i].contrast)]


def block_starts(lengths: Sequence[int], block_rows: int = BLOCK_ROWS) -> np.ndarray:
    """First row of each block when every unit is cut into blocks of about ``block_rows``; a unit that has no
    row of this joint has no block."""
    starts, first = [], 0
    for length in lengths:
        parts = max(1, round(length / block_rows)) if length else 0
        starts.extend(first + np.arange(parts) * length // parts)
        first += length
    return np.array(starts, dtype=int)


def squared_in_blocks(residual: Sequence[np.ndarray], starts: np.ndarray) -> np.ndarray:
    """(B,) sums of squares of the residuals (N,) of all units, in the blocks that begin at ``starts``."""
    return np.add.reduceat(np.concatenate(residual) ** 2, starts)


def signed_rank(values: np.ndarray, fewest: int = SIGNIFICANCE_LIMITS.fewest_blocks) -> float:
    """One-sided Wilcoxon: the p value of positive values against symmetry about zero; 1 for fewer than
    ``fewest``. Exact up to 25 values, else by the normal approximation; zeros do not count."""
    if len(values) < fewest or not np.any(values):
        return 1.0
    is_exact, values = len(values) <= MOST_EXACT_RANKS, values[values != 0]
    _, at, alike = np.unique(np.abs(values), return_inverse=True, return_counts=True)
    ranks = (np.cumsum(alike) - (alike - 1) / 2)[at]
    positive, count = float(ranks[values > 0].sum()), len(values)
    if is_exact:
        return float(_rank_sums(count)[int(positive) :].sum())
    variance = (count * (count + 1) * (2 * count + 1) - float((alike**3 - alike).sum()) / 2) / 24
    return _beyond((positive - count * (count + 1) / 4) / math.sqrt(variance))


@cache
def _rank_sums(count: int) -> np.ndarray:
    """Probabilities of each sum of those ranks, 1 to ``count``, that have a positive sign by chance."""
    found = np.ones(1)
    for rank in range(1, count + 1):
        found = (np.pad(found, (0, rank)) + np.pad(found, (rank, 0))) / 2
    return found


def random_signs(values: np.ndarray, fewest: int = SIGNIFICANCE_LIMITS.fewest_blocks) -> float:
    """The p value of the sum of ``values`` (B,) if each could as well have the other sign (normal
    approximation); 1 for fewer than ``fewest``."""
    scale = float(np.sqrt(np.sum(values**2)))
    if len(values) < fewest or scale == 0:
        return 1.0
    return _beyond(float(values.sum()) / scale)


def _beyond(z: float) -> float:
    """Probability of more than ``z`` standard deviations."""
    return 0.5 * math.erfc(z / math.sqrt(2.0))


def over_joints(
    values: Sequence[np.ndarray], takes: Sequence[np.ndarray], *, by_take: bool = False
) -> np.ndarray:
    """(B, ...) of each joint summed over joints; ``takes``: for each joint (B,), the take of each block.

    Joints that were measured in different takes have no blocks in common: they are summed take by take.
    """
    if not by_take and _are_in_step(takes):
        return np.sum(values, axis=0)
    total = np.zeros((1 + max(int(take.max()) for take in takes), *values[0].shape[1:]))
    for value, take in zip(values, takes, strict=True):
        np.add.at(total, take, value)
    return total[np.unique(np.concatenate(takes))]


def _are_in_step(takes: Sequence[np.ndarray]) -> bool:
    return all(np.array_equal(take, takes[0]) for take in takes)


def pooled_errors(errors: Sequence[JointErrors]) -> JointErrors:
    """All joints together, each block in units of its joint's mean."""
    takes = [item.take for item in errors]
    scale = [float(item.base.sum()) or 1.0 for item in errors]
    return JointErrors(
        *(
            over_joints([getattr(item, part) / s for item, s in zip(errors, scale, strict=True)], takes)
            for part in ("base", "added", "control")
        ),
        rows=sum(item.rows for item in errors),
        take=takes[0] if _are_in_step(takes) else np.unique(np.concatenate(takes)),
    )
