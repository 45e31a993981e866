"""Taking out earlier effects that a new one makes needless: an alias may have been added first."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from glovecal_models.calibration.held_out_check import HeldOutErrors
from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.training_settings import TrainingSettings
from glovecal_models.improvement.addition import Addition
from glovecal_models.improvement.limits import IMPROVEMENT_LIMITS, ImprovementLimits
from glovecal_models.improvement.remove_effect import remove_effect, unneeded
from glovecal_models.takes.take import Take


def pruned(
    addition: Addition,
    takes: Sequence[Take],
    errors: HeldOutErrors,
    settings: TrainingSettings,
    take_hashes: Sequence[str],
    cancelled: Callable[[], bool] | None,
    limits: ImprovementLimits = IMPROVEMENT_LIMITS,
) -> tuple[CalibrationModel, HeldOutErrors, list[str]]:
    """The child without them, the ``errors`` then, and a sentence for each that went. Raises Cancelled."""
    model, sentences = addition.model, []
    for earlier in addition.wanted:
        # An effect that widens the interval explains no error, and makes no other needless.
        if earlier.name == addition.effect or not earlier.has_columns or addition.claim is not None:
            continue
        without = unneeded(
            model, takes, earlier.name, errors.of(earlier.rotations), settings, cancelled, limits
        )
        if without is not None:
            errors = errors.with_those_of(without)
            sentences.append(f"{earlier.name} is not needed any more beside {addition.effect}.")
            model = remove_effect(
                model, takes, earlier.name, settings=settings, take_hashes=take_hashes, cancelled=cancelled
            )
    return model, errors, sentences
