"""The whole loop: train, diagnose, add, verify."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from glovecal._calls import Progress, library_call
from glovecal._diagnosis import Diagnosis
from glovecal._layouts import LayoutLike, layout_for
from glovecal._model import CalibrationModel
from glovecal._plotting import CONTROL, FLOOR, MODEL, SCALE, axes_for, finished, named_rows
from glovecal._shown import Shown
from glovecal._table import Column, Table
from glovecal._takes import takes_in
from glovecal_models.progress import Cancel
from glovecal_models.takes.take import Take

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from glovecal_models.calibration.training_settings import Method
    from glovecal_models.improvement.improvement import Improvement as InnerImprovement

COLUMNS = (Column("calibration"), Column("rmse_deg"), Column("with_control_rmse_deg"), Column("rotations"))
NOISE_FLOOR = "noise floor"


@dataclass(frozen=True, eq=False, repr=False)
class Improvement(Shown):
    """The fall of the error: from no calibration through every effect added down to the noise floor."""

    inner: InnerImprovement
    """``glovecal_models.improvement.improvement.Improvement``: every step, what was undone and why."""

    @property
    def model(self) -> CalibrationModel:
        """The last one, with every effect that stayed."""
        return self.models[-1]

    @property
    def models(self) -> tuple[CalibrationModel, ...]:
        """One for each step, the first without effects."""
        return tuple(CalibrationModel(item) for item in self.inner.models)

    @property
    def effects(self) -> tuple[str, ...]:
        """Those that were added, in order."""
        return tuple(step.added.effect for step in self.inner.steps if step.added is not None)

    @property
    def rmse_deg(self) -> tuple[float, ...]:
        """Error after each step over all rotations, degrees."""
        return tuple(step.rmse_deg for step in self.inner.steps)

    @property
    def noise_floor_deg(self) -> float | None:
        """Over all rotations (root mean square), degrees; None where it is unknown."""
        floors = [floor.floor_deg for floor in self.inner.noise_floor.values()]
        return float(np.sqrt(np.mean(np.square(floors)))) if floors else None

    @property
    def stopped(self) -> str:
        """Why it ended, such as ``noise_floor`` or ``nothing_named``."""
        return self.inner.stopped

    @property
    def sentences(self) -> tuple[str, ...]:
        """What happened, and what is left."""
        from glovecal_models.improvement.text import improvement_sentences

        return tuple(improvement_sentences(self.inner))

    @property
    def diagnosis(self) -> Diagnosis | None:
        """The last one: what is left, and what to record next."""
        return None if self.inner.diagnosis is None else Diagnosis(self.inner.diagnosis)

    def table(self) -> Table:
        """Simpler calibrations, every step, and the noise floor."""
        rows: list[tuple[str | float | None, ...]] = [
            (name, error, None, None) for name, error in self.inner.baselines.items()
        ]
        for step in self.inner.steps:
            label = self.inner.models[0].method if step.added is None else f"+ {step.added.effect}"
            where = None if step.added is None else ", ".join(step.added.where)
            rows.append((label, step.rmse_deg, step.control_rmse_deg, where))
        rows.append((NOISE_FLOOR, self.noise_floor_deg, None, None))
        return Table.of(COLUMNS, rows, after=self.sentences)

    def plot(self, ax: Axes | None = None) -> Axes:
        """The fall of the error as bars, each effect beside its control; gives the axes back."""
        rows = self.table().rows[:-1]
        axes = axes_for(ax, len(rows))
        simpler = len(self.inner.baselines)
        for row, (_, error, control, _) in enumerate(rows):
            axes.barh(row, _degrees(error), color=SCALE if row < simpler else MODEL)
            if control is not None:
                axes.plot(_degrees(control), row, "D", color=CONTROL, label="with the control instead")
        if self.noise_floor_deg is not None:
            axes.axvline(self.noise_floor_deg, color=FLOOR, linestyle="--", label=NOISE_FLOOR)
        named_rows(axes, [str(row[0]) for row in rows])
        axes.set_xlim(left=0.0)
        axes.set_xlabel("held-out error (degrees)")
        return finished(axes)


def _degrees(value: Any) -> float:
    return float("nan") if value is None else float(value)


def improve(
    takes: Take | Iterable[Take],
    *,
    layout: LayoutLike = None,
    held_out: Take | Iterable[Take] | None = None,
    method: Method = "lmc_gpr",
    subject: str = "unnamed",
    samples: int = 2000,
    max_steps: int = 6,
    seed: int = 0,
    ceiling: bool = False,
    cancelled: Cancel | None = None,
    progress: Progress = None,
) -> Improvement:
    """Train, then diagnose, add and verify until the noise floor, or until nothing more can be named.

    ``layout`` and ``method`` as for ``train``. Errors are on ``held_out`` when it is given, else on takes
    held out of each fit. At most ``max_steps`` effects are added.
    ``ceiling``: see whether anything is left to gain at the end (extra ``ceiling``).
    Raises NotTrainable, BadInput, Cancelled.
    """
    from glovecal_models.calibration.training_settings import TrainingSettings
    from glovecal_models.improvement.improve import improve as improve_inner

    takes = takes_in(takes)
    with library_call(progress) as report:
        found = improve_inner(
            takes,
            layout_for(layout, takes),
            subject,
            TrainingSettings(method, samples=samples, seed=seed),
            holdout=() if held_out is None else takes_in(held_out),
            max_steps=max_steps,
            seed=seed,
            ceiling=ceiling,
            cancelled=cancelled,
            report=report,
        )
    return Improvement(found)
