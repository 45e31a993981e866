"""A model against measurements."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from glovecal._calls import library_call
from glovecal._model import CalibrationModel, inner_model
from glovecal._plotting import FLOOR, MODEL, axes_for, finished, named_rows
from glovecal._shown import Shown
from glovecal._table import Column, Table
from glovecal._takes import takes_in
from glovecal_models.takes.take import Take

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from glovecal_models.comparison.compare import Comparison as InnerComparison
    from glovecal_models.comparison.compare import RotationErrors

COLUMNS = (
    Column("rotation"), Column("frames"), Column("rmse_deg"), Column("noise_floor_deg"),
    Column("noise_floor_low_deg"), Column("noise_floor_high_deg"), Column("bias_deg"), Column("mae_deg"),
    Column("percentile_95_deg"), Column("coverage_1_sd"), Column("predicting_the_mean_deg"),
)  # fmt: skip
OVERALL = "all rotations"
FLOOR_LABEL = "noise floor, 95 % interval"


@dataclass(frozen=True, eq=False, repr=False)
class Comparison(Shown):
    """Errors of a model, predicted minus measured, beside the noise floor of the measurements."""

    inner: InnerComparison
    """``glovecal_models.comparison.compare.Comparison``: also errors by pose and of the fingertips (mm)."""

    @property
    def rmse_deg(self) -> float:
        """Over all rotations and frames, degrees."""
        return self.inner.overall.rmse_deg

    @property
    def noise_floor_deg(self) -> float | None:
        """How small the error can get on these measurements, degrees; None where it is unknown."""
        floor = self.inner.overall.floor
        return None if floor is None else floor.floor_deg

    @property
    def per_rotation_deg(self) -> dict[str, float]:
        """RMSE of each measured rotation, degrees."""
        return {name: errors.rmse_deg for name, errors in self.inner.rotations.items()}

    @property
    def coverage(self) -> float:
        """Share of measurements within one claimed standard deviation; 0.68 is expected."""
        return self.inner.overall.coverage

    @property
    def fingertip_rmse_mm(self) -> float | None:
        """How far the fingertips are off, mm; None where no finger was predicted and measured as a whole."""
        tips = self.inner.fingertips
        return None if tips is None else tips.overall.rmse_mm

    def table(self) -> Table:
        """One row for each rotation, and one for all of them."""
        rows = [_row(name, errors) for name, errors in self.inner.rotations.items()]
        after, tips = [], self.inner.fingertips
        if tips is not None:
            hand = f"{tips.hand_length_mm:.0f} mm{' (assumed)' if tips.is_assumed else ''}"
            after.append(f"Fingertips: {tips.overall.rmse_mm:.1f} mm (RMSE), for a hand length of {hand}.")
        if self.inner.not_measured:
            after.append(f"Not measured in these takes: {', '.join(self.inner.not_measured)}.")
        if self.inner.not_predicted:
            after.append(f"Not predicted by this model: {', '.join(self.inner.not_predicted)}.")
        return Table.of(COLUMNS, [*rows, _row(OVERALL, self.inner.overall)], after=after)

    def plot(self, ax: Axes | None = None) -> Axes:
        """Error of each rotation beside its noise floor with a 95 % interval; gives the axes back."""
        every = self.inner.rotations
        axes = axes_for(ax, len(every))
        axes.barh(range(len(every)), [e.rmse_deg for e in every.values()], color=MODEL, label="RMSE")
        for row, errors in enumerate(every.values()):
            if errors.floor is not None:
                floor = errors.floor
                axes.plot([floor.low_deg, floor.high_deg], [row, row], color=FLOOR, linewidth=2)
                axes.plot(floor.floor_deg, row, "|", color=FLOOR, markersize=12, mew=3, label=FLOOR_LABEL)
        named_rows(axes, list(every))
        axes.set_xlabel("error (degrees)")
        return finished(axes)


def _row(name: str, errors: RotationErrors) -> tuple[str | int | float | None, ...]:
    floor = errors.floor
    floors = (None,) * 3 if floor is None else (floor.floor_deg, floor.low_deg, floor.high_deg)
    return (
        name, errors.count, errors.rmse_deg, *floors, errors.bias_deg, errors.mae_deg,
        errors.percentile_95_deg, errors.coverage, errors.baseline_deg,
    )  # fmt: skip


def compare(
    model: CalibrationModel, takes: Take | Iterable[Take], *, hand_length_mm: float | None = None
) -> Comparison:
    """Hold a model against takes with reference angles, best such as it was not trained on.

    ``hand_length_mm``: from the wrist crease to the tip of the middle finger, for errors of fingertips.
    Raises BadInput when nothing was measured, when the takes are of another layout, or for a length that no
    hand has.
    """
    from glovecal_models.comparison.compare import compare as compare_inner
    from glovecal_models.hand.dimensions import HandDimensions

    length = None if hand_length_mm is None else {"hand_length": hand_length_mm}
    hand = None if length is None else HandDimensions.from_measured(length)
    with library_call():
        return Comparison(compare_inner(inner_model(model), takes_in(takes), dimensions=hand))
