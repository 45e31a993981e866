"""Adding one effect to a calibration: kept when the held-out error falls, else undone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from glovecal_models.calibration.added_effect import AddedEffect
from glovecal_models.calibration.child_model import child_model, columnless_effects, kept_lanes
from glovecal_models.calibration.effect_fit import fit_with_effects
from glovecal_models.calibration.effect_request import EffectRequest
from glovecal_models.calibration.held_out_check import HeldOutErrors, held_out_errors
from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.model_recipe import (
    effect_named,
    repaired_takes,
    requested_effects,
    settings_of,
    trained_rotations,
)
from glovecal_models.calibration.prepared_takes import PreparedTakes
from glovecal_models.calibration.training_settings import TrainingSettings
from glovecal_models.diagnosis.signatures import own_sensors
from glovecal_models.effects.base.effect import Effect
from glovecal_models.effects.base.interval_effect import IntervalEffect
from glovecal_models.effects.base.signals import Signals
from glovecal_models.effects.base.signature_effect import LiveCheck, SignatureEffect
from glovecal_models.errors import BadInput
from glovecal_models.improvement.add_interval import add_interval
from glovecal_models.improvement.addition import Addition, total_rmse_deg
from glovecal_models.improvement.control_share import share_left_by_control
from glovecal_models.improvement.limits import IMPROVEMENT_LIMITS, ImprovementLimits
from glovecal_models.improvement.proposals import proposed
from glovecal_models.names import did_you_mean
from glovecal_models.progress import Cancel, Report, part
from glovecal_models.takes.take import Take


def add_effect(
    model: CalibrationModel,
    takes: Sequence[Take],
    effect: str | Effect,
    *,
    rotations: Sequence[str] | None = None,
    constants: dict[str, Any] | None = None,
    settings: TrainingSettings | None = None,
    before: HeldOutErrors | None = None,
    judged: Sequence[str] | None = None,
    least_gain: float | None = None,
    control_share: float | None = None,
    parent_id: str | None = None,
    take_hashes: Sequence[str] = (),
    limits: ImprovementLimits = IMPROVEMENT_LIMITS,
    cancelled: Cancel | None = None,
    report: Report | None = None,
) -> Addition:
    """Learn ``model`` anew with ``effect``, or that of a name, on ``rotations`` (default: all measured ones).

    ``takes`` are the training takes. ``constants``: settings of an effect without columns, such as the
    clocks' offsets (default: as they are found in the takes). ``before`` saves measuring the parent,
    ``control_share`` (of the error that is left with the control instead) screening it. Undone, with
    the reason, unless the held-out RMSE of the ``judged`` rotations (default: all chosen) falls by
    ``least_gain`` (default: of ``limits``), and where the control leaves less than the effect; an effect
    that widens the interval is judged by its claim (``add_interval``). Raises BadInput for an unknown effect
    or rotation, or when the takes cannot carry it; Cancelled.
    """
    effect = effect_named(model, effect) if isinstance(effect, str) else effect
    name = effect.name
    settings = settings_of(model, settings)
    least_gain = limits.least_gain if least_gain is None else least_gain
    has = requested_effects(model)
    if constants is None and isinstance(effect, SignatureEffect):
        proposal = proposed(model, takes, effect, rotations, cancelled, limits.diagnosis)
        constants, rotations = proposal.constants, proposal.rotations or rotations
    chosen = _chosen(model, effect, rotations)
    fresh = EffectRequest(effect, chosen, dict(constants or {}))
    wanted = (*(item for item in has if item.name != name), _joined(has, fresh))
    prepared = PreparedTakes.of(repaired_takes(takes, wanted), model.layout)
    if isinstance(effect, IntervalEffect):
        return add_interval(
            model, effect, fresh, has, prepared, settings, parent_id=parent_id, take_hashes=take_hashes,
            limits=limits, cancelled=cancelled,
        )  # fmt: skip
    if fresh.has_columns:
        _require_judgeable(prepared, effect.not_applicable_reason(_all_signals(prepared)), name)
    before = before or held_out_errors(
        PreparedTakes.of(repaired_takes(takes, has), model.layout), chosen, has, settings,
        cancelled=cancelled, report=part(report, 0.0, 0.4, "measuring what there is"),
    )  # fmt: skip
    if report:
        report(f"learning {name} from all takes", 0.4)
    fit = fit_with_effects(prepared, chosen, wanted, settings, cancelled=cancelled)
    wanted = tuple(_with_found(item, fit.effects) for item in wanted)
    with_it = part(report, 0.5, 0.9, f"with {name}")
    after = held_out_errors(
        prepared, chosen, wanted, settings, optima=fit.optima, cancelled=cancelled,
        report=with_it,
    )  # fmt: skip
    undone = Addition(
        name, chosen, False, before, after, model, has, judged=tuple(judged or chosen), least_gain=least_gain
    )
    # Where it does not pay on all of them together, it may on some: there alone it is kept.
    worse_times = limits.worse_times if undone.gain >= least_gain else 1.0 - least_gain
    kept = _not_worse(before, after, chosen, worse_times)
    if fresh.has_columns and least_gain >= 0 and 0 < len(kept) < len(chosen):
        judged = [item for item in judged or kept if item in kept] or None
        found = add_effect(
            model, takes, effect, rotations=kept, constants=constants, settings=settings, judged=judged,
            before=before.of(kept), least_gain=least_gain, parent_id=parent_id, take_hashes=take_hashes,
            limits=limits, cancelled=cancelled, report=report,
        )  # fmt: skip
        return replace(found, left_out=tuple(item for item in chosen if item not in kept))
    if undone.gain < least_gain:
        return undone
    has_form = any(item.name == name and item.curves for item in fit.effects)
    if fresh.has_columns and (has_form or control_share is None):
        control_share = share_left_by_control(
            model, repaired_takes(takes, has), effect, chosen, known_share=control_share,
            has_form=has_form, cancelled=cancelled, limits=limits.diagnosis,
        )  # fmt: skip
    if control_share is not None:
        undone = replace(undone, control_rmse_deg=control_share * total_rmse_deg(before, chosen))
    # Who asks for an effect whatever it does (a negative least gain) gets it.
    if undone.is_beaten_by_control and least_gain >= 0:
        return undone
    live = None
    if isinstance(effect, SignatureEffect):
        fresh, live = _acting_live(model, takes, has, fresh, effect, cancelled)
        wanted = (*(item for item in has if item.name != name), _joined(has, fresh))
    evidence = _evidence(before, after, chosen, control_share) | dict(live.evidence if live else {})
    effects = [*kept_lanes(model.effects, chosen), *fit.effects, *columnless_effects(wanted, model.effects)]
    effects = [replace(item, evidence=evidence) if item.name == name else item for item in effects]
    whole = before.with_those_of(after)
    child = child_model(
        model, parent_id, prepared, fit, effects, whole, settings, take_hashes, wanted, cancelled
    )
    mine = [item.described() for item in fit.effects if item.name == name]
    described = {key: value for each in mine for key, value in each.items()}
    parent_deg, child_deg = (item.error_estimate.get("rmse_deg") for item in (model, child))
    of_all = None if parent_deg is None or child_deg is None else (float(parent_deg), float(child_deg))
    return replace(
        undone, added=True, model=child, wanted=tuple(wanted), parameters=described, live=live,
        of_all_deg=of_all,
    )  # fmt: skip


def _not_worse(
    before: HeldOutErrors, after: HeldOutErrors, rotations: Sequence[str], worse_times: float
) -> tuple[str, ...]:
    """Rotations whose held-out error rises by no more than to ``worse_times`` with the effect."""
    return tuple(
        name
        for name in rotations
        if total_rmse_deg(after, [name]) <= worse_times * total_rmse_deg(before, [name])
    )


def _chosen(model: CalibrationModel, effect: Effect, rotations: Sequence[str] | None) -> tuple[str, ...]:
    """A repaired reference concerns all rotations. Raises BadInput."""
    every = trained_rotations(model)
    chosen = tuple(every if rotations is None or effect.kind == "repair" else rotations)
    unknown = [item for item in chosen if item not in every]
    if unknown:
        meant = did_you_mean(unknown[0], every, there="it has")
        raise BadInput(f"no rotation {unknown[0]!r} is trained in this model; {meant}")
    return chosen


def _acting_live(
    model: CalibrationModel,
    takes: Sequence[Take],
    has: Sequence[EffectRequest],
    fresh: EffectRequest,
    effect: SignatureEffect,
    cancelled: Cancel | None,
) -> tuple[EffectRequest, LiveCheck | None]:
    """The effect with what it needs to act on live frames, where it can."""
    others = repaired_takes(takes, [item for item in has if item.name != fresh.name])
    trained = trained_rotations(model)
    reads = {
        item.rotation: item.correspondence.sensors for item in model.rotations if item.rotation in trained
    }
    sensor_of = own_sensors(model.layout, trained)
    live = effect.checked_live(others, sensor_of, model.layout.sensors, reads, cancelled)
    return (fresh, None) if live is None else (replace(fresh, settings=fresh.settings | live.settings), live)


def _evidence(
    before: HeldOutErrors, after: HeldOutErrors, rotations: Sequence[str], control_share: float | None
) -> dict[str, float]:
    """The held-out errors of ``rotations`` without the effect, with it, and with its control."""
    rmse_before = total_rmse_deg(before, rotations)
    found = {"rmse_before_deg": rmse_before, "rmse_after_deg": total_rmse_deg(after, rotations)}
    return found if control_share is None else found | {"rmse_control_deg": control_share * rmse_before}


def _joined(has: Sequence[EffectRequest], fresh: EffectRequest) -> EffectRequest:
    """The effect on the rotations that have it already, too."""
    before = next((item for item in has if item.name == fresh.name), None)
    if before is None:
        return fresh
    return EffectRequest(
        fresh.effect,
        tuple(dict.fromkeys((*before.rotations, *fresh.rotations))),
        fresh.settings or before.settings,
    )


def _with_found(request: EffectRequest, learned: Sequence[AddedEffect]) -> EffectRequest:
    """With what was searched in all takes: folds have too few to search it again."""
    mine = next((item for item in learned if item.name == request.name), None)
    if mine is None:
        return request
    return replace(request, settings=mine.effect.settings_with_found(request.settings, mine.settings))


def _require_judgeable(takes: PreparedTakes, why: str | None, name: str) -> None:
    if why is not None:
        raise BadInput(f"effect {name!r} cannot be learned from these {len(takes.takes)} takes: {why}")


def _all_signals(takes: PreparedTakes) -> list[Signals]:
    """Signals of all joints as measured, to ask whether an effect can be judged at all."""
    own = [np.where(np.isfinite(part), part, 0.0) for part in takes.reference]
    return takes.signals(own, np.zeros(own[0].shape[1]), frozenset())
