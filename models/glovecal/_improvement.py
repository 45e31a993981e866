"""The whole loop: train, diagnose, add, verify."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from glovecal._calls import Progress, library_call
from glovecal._diagnosis import Diagnosis
from glovecal._layouts import LayoutLike, layout_for
from glovecal._model import CalibrationModel
from glovecal._takes import takes_in
from glovecal_models.presentation.document import Answer, Presentation
from glovecal_models.progress import Cancel
from glovecal_models.takes.take import Take

if TYPE_CHECKING:
    from glovecal_models.calibration.methods import Method
    from glovecal_models.improvement.improvement import Improvement as InnerImprovement


@dataclass(frozen=True, eq=False, repr=False)
class Improvement(Answer):
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
        from glovecal_models.diagnosis.text import missing_effects

        found = self.inner.diagnosis
        return None if found is None else Diagnosis(found, missing_effects(found))

    def presentation(self) -> Presentation:
        from glovecal_models.improvement.text import improved

        return improved(self.inner).presentation()


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
