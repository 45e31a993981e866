"""One estimate of a noise floor, with the interval that its own pieces give it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal

import numpy as np

from glovecal_models.presentation.document import answer

How = Literal[
    "still hand", "still joint", "repeated poses", "spectrum", "frame to frame", "near readings", "stated",
]  # fmt: skip
ORDER: tuple[How, ...] = (
    "still hand", "still joint", "repeated poses", "spectrum", "frame to frame", "near readings", "stated",
)  # fmt: skip
"""The best first; ``noise_floor.py`` says why."""
LOWER_BOUNDS: tuple[How, ...] = ("spectrum", "frame to frame")
RESAMPLES = 500


@answer
class NoiseFloor:
    """The floor of one rotation with its 95 % interval, degrees."""

    floor_deg: float
    """How small an error can get on these measurements."""
    low_deg: float
    """95 % interval, from resampled pieces."""
    high_deg: float
    prediction_deg: float
    """The part that is the prediction's own jitter; the reference is the rest."""
    how: How
    """The best first. stated: what the reference states of itself is larger than any of these."""
    pieces: int
    """Holds, repeats or blocks of time that it was pooled from, and resampled for the interval."""
    reasons: Sequence[str] = ()
    """Why it is not reliable, each as the end of a sentence; none where it is."""
    estimate_deg: float | None = None
    """The estimate itself, where it lies above the error beside which the floor stands."""
    reference_deg: float | None = None
    """RMS of the standard deviations that a camera states; null: none are stated."""
    is_lower_bound: bool = False
    """Autocorrelated noise is not included."""
    is_reliable: bool = True
    """Whether nothing speaks against it."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "is_lower_bound", self.how in LOWER_BOUNDS)
        object.__setattr__(self, "is_reliable", not self.reasons)

    @property
    def ends(self) -> tuple[float, float, float]:
        """The floor, then its interval."""
        return self.floor_deg, self.low_deg, self.high_deg

    @property
    def with_interval(self) -> str:
        return f"{self.floor_deg:.2f} ({self.low_deg:.2f}-{self.high_deg:.2f})"

    @property
    def long_text(self) -> str:
        least = "at least " if self.is_lower_bound else ""
        return f"{least}{self.with_interval}{'' if self.is_reliable else ', not reliable'}"

    def with_stated(self, reference_deg: float) -> NoiseFloor:
        """The floor of angles whose reference states ``reference_deg``: never below it. Errors of a camera
        last too long for a hold to show them whole."""
        if self.floor_deg >= reference_deg:
            return replace(self, reference_deg=reference_deg)
        return replace(
            stated_floor(reference_deg, self.pieces), prediction_deg=self.prediction_deg, reasons=self.reasons
        )

    def beside(self, rmse_deg: float) -> NoiseFloor:
        """The floor of an error of ``rmse_deg``, never above it: not its value, not its interval.

        An estimate whose whole interval lies above the error is wrong, and marked as such.
        """
        if self.high_deg <= rmse_deg:
            return self
        reasons, estimate = self.reasons, self.estimate_deg
        if self.floor_deg > rmse_deg:
            estimate = self.floor_deg
        if self.low_deg > rmse_deg:
            why = f"the estimate ({self.floor_deg:.2f} degrees) lies above the error ({rmse_deg:.2f})"
            reasons = (*reasons, why)
        return replace(
            self,
            floor_deg=min(self.floor_deg, rmse_deg),
            low_deg=min(self.low_deg, rmse_deg),
            high_deg=rmse_deg,
            reasons=reasons,
            estimate_deg=estimate,
        )


def interval_text(floor: NoiseFloor | None) -> str | None:
    """As a cell has it: ">0.50" for a lower bound, "0.45-0.55?" for one that is not reliable."""
    if floor is None:
        return None
    doubt = "" if floor.is_reliable else "?"
    if floor.is_lower_bound:
        return f">{floor.floor_deg:.2f}{doubt}"
    return f"{floor.low_deg:.2f}-{floor.high_deg:.2f}{doubt}"


def floor_text(floor: NoiseFloor, digits: int = 2) -> str:
    """A floor in degrees and how far it can be trusted, as it stands behind "noise floor"."""
    bound = "lower bound " if floor.is_lower_bound else ""
    doubt = f", not reliable: {'; '.join(floor.reasons)}" if floor.reasons else ""
    return f"{bound}{floor.floor_deg:.{digits}f}{doubt}"


def pooled(
    squares: np.ndarray, freedom: np.ndarray, jitter_deg: float, how: How, generator: np.random.Generator
) -> NoiseFloor:
    """Root of the sum of ``squares`` over the sum of ``freedom``, whole pieces resampled for the interval."""
    drawn = generator.integers(0, len(squares), (RESAMPLES, len(squares)))
    resampled = np.sqrt(squares[drawn].sum(axis=1) / freedom[drawn].sum(axis=1))
    low, high = np.percentile(resampled, [2.5, 97.5])
    floor = float(np.sqrt(squares.sum() / freedom.sum()))
    return NoiseFloor(floor, float(low), float(high), jitter_deg, how, len(squares))


def stated_floor(reference_deg: float, pieces: int) -> NoiseFloor:
    """What a reference states of itself, where nothing was estimated, or less."""
    return NoiseFloor(
        reference_deg, reference_deg, reference_deg, 0.0, "stated", pieces, reference_deg=reference_deg
    )


def joined(floors: Sequence[NoiseFloor], weights: Sequence[float]) -> NoiseFloor:
    """The floor of several rotations taken together, each weighted by its frames.

    The rotations of one take share their holds, so their estimates may all be off the same way: the interval
    joins the low ends, and the high ends. It is as good as the weakest way among them.
    """
    shares = np.array(weights, dtype=float) / np.sum(weights)

    def root(name: str) -> float:
        return float(np.sqrt(shares @ np.array([getattr(one, name) for one in floors]) ** 2))

    how = ORDER[max(ORDER.index(one.how) for one in floors)]
    pieces = min(one.pieces for one in floors)
    reasons = tuple(dict.fromkeys(reason for one in floors for reason in one.reasons))
    stated = [one.reference_deg or 0.0 for one in floors]
    reference = float(np.sqrt(shares @ np.array(stated) ** 2)) if any(stated) else None
    return NoiseFloor(
        root("floor_deg"), root("low_deg"), root("high_deg"), root("prediction_deg"), how, pieces, reasons,
        reference_deg=reference,
    )  # fmt: skip
