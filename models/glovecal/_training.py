"""Training."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from glovecal._calls import Progress, library_call
from glovecal._fits import fitted
from glovecal._layouts import LayoutLike, layout_for
from glovecal._model import CalibrationModel
from glovecal._takes import takes_in
from glovecal_models.progress import Cancel
from glovecal_models.takes.take import Take

if TYPE_CHECKING:
    from glovecal_models.calibration.methods import Method


def train(
    takes: Take | Iterable[Take],
    *,
    layout: LayoutLike = None,
    method: Method = "lmc_gpr",
    subject: str = "unnamed",
    samples: int = 2000,
    folds: int = 3,
    seed: int = 0,
    keep_dead: bool = False,
    workers: int = 1,
    cancelled: Cancel | None = None,
    progress: Progress = None,
) -> CalibrationModel:
    """Learn the map from readings to rotations from takes with reference angles.

    ``layout``: a Layout, a built-in name or a file; without it each rotation is read from the sensor of its
    name, else from all. ``method``: ``lmc_gpr``, ``linear``, ``spgp``, ``auto`` (picks a kernel for each
    rotation), ``polynomial_gpr``, ``general_gpr`` or ``raw`` (no calibration). ``samples``: at most so many
    for one rotation. ``folds``: for the held-out error; 0 trains without one, which is faster. ``keep_dead``:
    refuse sensors that never move instead of leaving them out. ``workers``: processes that fit rotations side
    by side, which pays for whole gloves. The same takes and choices give the same model, to the byte,
    whatever the workers. Raises NotTrainable, BadInput, Cancelled, WorkerDied (out of memory).
    """
    from glovecal_models.calibration.training import assemble
    from glovecal_models.calibration.training import train as train_inner
    from glovecal_models.calibration.training_plan import plan_training
    from glovecal_models.calibration.training_settings import TrainingSettings

    takes = takes_in(takes)
    settings = TrainingSettings(method, samples=samples, folds=folds, seed=seed, keep_dead=keep_dead)
    layout = layout_for(layout, takes)
    with library_call(progress) as report:
        if workers > 1:
            plan = plan_training(takes, layout, subject, settings)
            model = assemble(plan, fitted(plan.tasks, workers, cancelled, report), take_hashes=())
        else:
            model = train_inner(takes, layout, subject, settings, cancelled=cancelled, report=report)
        report("done", 1.0)
    return CalibrationModel(model)
