"""Adding an effect that widens the claimed interval: angles stay, standard deviations become truer."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from glovecal_models.calibration.added_effect import AddedEffect
from glovecal_models.calibration.held_out_check import HeldOutErrors
from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.prepared_takes import PreparedTakes
from glovecal_models.calibration.training_settings import TrainingSettings
from glovecal_models.calibration.wanted_effect import WantedEffect
from glovecal_models.effects.base.interval_effect import IntervalEffect, LeftOutErrors
from glovecal_models.improvement.addition import Addition, total_rmse_deg
from glovecal_models.improvement.claim_check import ClaimCheck, check_claim
from glovecal_models.improvement.left_out_errors import left_out_errors
from glovecal_models.improvement.limits import IMPROVEMENT_LIMITS, ImprovementLimits


def add_interval(
    model: CalibrationModel,
    effect: IntervalEffect,
    fresh: WantedEffect,
    has: Sequence[WantedEffect],
    takes: PreparedTakes,
    settings: TrainingSettings,
    *,
    parent_id: str | None = None,
    take_hashes: Sequence[str] = (),
    limits: ImprovementLimits = IMPROVEMENT_LIMITS,
    cancelled: Callable[[], bool] | None = None,
) -> Addition:
    """``model`` with ``fresh``, if the NLPD on takes left out falls with it; its regressors stay as they are.

    An effect that ``shows_later`` than takes last stays when the NLPD does not rise.
    ``has``: the model's effects. Raises BadInput for fewer than three takes, NotTrainable, Cancelled.
    """
    others = [item for item in has if item.name != fresh.name]
    earlier = next((item for item in has if item.name == fresh.name), None)
    found = dict(earlier.settings if earlier else {}) | fresh.settings
    left_out = left_out_errors(takes, fresh.rotations, others, settings, limits=limits, cancelled=cancelled)
    errors = _errors(left_out)
    claim = check_claim(effect, left_out, found, limits)
    learned = effect.learned(left_out, found)
    shows_later = effect.shows_later and claim.is_no_worse and effect.widens(learned, fresh.rotations)
    if not claim.is_truer and not shows_later:
        sentence = _undone(fresh, claim)
        return Addition(
            fresh.name, fresh.rotations, False, sentence, errors, errors, model, tuple(has), claim=claim
        )
    rotations = tuple(dict.fromkeys((*(earlier.rotations if earlier else ()), *fresh.rotations)))
    nothing = np.zeros((len(rotations), 0))
    added = AddedEffect(
        fresh.name, rotations, learned, nothing, nothing, np.zeros(len(rotations)), claim.to_document()
    )
    kept = tuple(item for item in model.effects if item.name != fresh.name)
    child = replace(model, effects=(*kept, added), parent=parent_id, takes=tuple(take_hashes) or model.takes)
    wanted = (*others, WantedEffect(fresh.name, rotations, learned))
    sentence = f"{_where(fresh)}: {effect.sentence(learned, fresh.rotations)}. {_told(claim, errors, fresh)}"
    return Addition(
        fresh.name, fresh.rotations, True, sentence, errors, errors, child, wanted, added.described(), claim
    )


def _errors(left_out: Sequence[LeftOutErrors]) -> HeldOutErrors:
    square: dict[str, float] = {}
    count: dict[str, int] = {}
    for item in left_out:
        square[item.rotation] = square.get(item.rotation, 0.0) + float(item.error @ item.error)
        count[item.rotation] = count.get(item.rotation, 0) + len(item.error)
    return HeldOutErrors(square, count)


def _where(fresh: WantedEffect) -> str:
    names = fresh.rotations
    return f"{fresh.name} on {', '.join(names) if len(names) <= 4 else f'{len(names)} rotations'}"


def _told(claim: ClaimCheck, errors: HeldOutErrors, fresh: WantedEffect) -> str:
    before, after = claim.before, claim.after
    verb = "falls" if claim.is_truer else "goes"
    short = "" if claim.is_truer else ": they are too short to show what a longer session does"
    return (
        f"On takes left out the NLPD {verb} from {before.nlpd:.2f} to {after.nlpd:.2f} nats{short}; the "
        f"interval for 95 % of the measurements holds {100 * after.coverage_95:.0f} % (before "
        f"{100 * before.coverage_95:.0f} %), the error stays at "
        f"{total_rmse_deg(errors, fresh.rotations):.2f} degrees."
    )


def _undone(fresh: WantedEffect, claim: ClaimCheck) -> str:
    return (
        f"{_where(fresh)} was undone: it brings the claimed standard deviation no nearer to the truth (NLPD "
        f"on takes left out {claim.before.nlpd:.3f} to {claim.after.nlpd:.3f} nats; "
        f"{claim.limits.claim_least_fall_nats} less is asked for)."
    )
