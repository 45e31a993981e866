"""Adding one effect to a calibration: kept when the held-out error falls, else undone.

Effects without columns as they would be added: looked for in the takes, by their signature.
"""

from __future__ import annotations

from collections.abc import Sequence, Set
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from glovecal_models.calibration.added_effect import AddedEffect, EffectRequest, columnless_effects
from glovecal_models.calibration.effect_fit import fit_with_effects
from glovecal_models.calibration.learned_lead import with_leads
from glovecal_models.calibration.leave_out import HeldOutErrors, held_out_errors
from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.prepared_takes import PreparedTakes
from glovecal_models.calibration.training_settings import (
    TrainingSettings,
    effect_named,
    repaired_takes,
    requested_effects,
    settings_of,
    trained_rotations,
)
from glovecal_models.diagnosis.diagnosis import Diagnosis
from glovecal_models.diagnosis.known_effect import known_effects
from glovecal_models.diagnosis.limits import DIAGNOSIS_LIMITS, DiagnosisLimits
from glovecal_models.diagnosis.model_on_takes import ModelOnTakes
from glovecal_models.diagnosis.signatures import are_held_levels, are_pose_labels, own_sensors, static_errors
from glovecal_models.effects.base.effect import (
    CorrectionEffect,
    Effect,
    IntervalEffect,
    LiveRepair,
    RepairEffect,
    SignatureEffect,
    is_asked_last,
)
from glovecal_models.effects.base.findings import FoundBefore, LiveCheck, Proposal, Recorded
from glovecal_models.effects.base.signals import Signals
from glovecal_models.effects.catalogue import (
    catalogue,
    relations,
)
from glovecal_models.errors import BadInput
from glovecal_models.improvement.addition import (
    Addition,
    Lineage,
    add_interval,
    share_left_by_control,
    total_rmse_deg,
)
from glovecal_models.improvement.limits import IMPROVEMENT_LIMITS, ImprovementLimits
from glovecal_models.improvement.remove_effect import child_model, kept_lanes
from glovecal_models.names import did_you_mean
from glovecal_models.progress import Cancel, Report, part
from glovecal_models.takes.take import Take


class Proposed(NamedTuple):
    """One effect to be added."""

    effect: str
    proposal: Proposal


def repairs(
    model: CalibrationModel, takes: Sequence[Take], without: Set[str], found_before: FoundBefore | None = None
) -> list[Proposed]:
    """What the measurement needs; ``without`` is not looked for."""
    return _looked_for(model, takes, RepairEffect, without, found_before)


def widenings(
    model: CalibrationModel,
    takes: Sequence[Take],
    diagnosis: Diagnosis | None,
    without: Set[str],
    found_before: FoundBefore | None = None,
) -> list[Proposed]:
    """What is left when nothing more is to be corrected: where and how much the interval has to be wider.

    An effect that is asked for last is proposed where the diagnosis found it.
    """
    rotations, last = trained_rotations(model), []
    signature = [] if diagnosis is None or are_pose_labels(takes) else diagnosis.signature
    for name in dict.fromkeys(item.effect for item in signature):
        effect = catalogue()[name]
        found = [item for item in signature if item.effect == name]
        where = tuple(dict.fromkeys(place for item in found for place in item.where if place in rotations))
        if is_asked_last(effect) and where and name not in without:
            last.append(Proposed(name, Proposal({}, where, tuple(item.sentence for item in found))))
    late = {name for name, item in catalogue().items() if is_asked_last(item)}
    return [*last, *_looked_for(model, takes, IntervalEffect, without | late, found_before)]


def proposed(
    model: CalibrationModel,
    takes: Sequence[Take],
    effect: SignatureEffect,
    rotations: Sequence[str] | None,
    cancelled: Cancel | None = None,
    limits: DiagnosisLimits = DIAGNOSIS_LIMITS,
) -> Proposal:
    """What is found of ``effect`` in ``takes``, as it would be added on ``rotations`` (None: where it is
    found). Raises BadInput when nothing is found, Cancelled."""
    if is_asked_last(effect) and rotations is not None:
        return Proposal({}, tuple(rotations))
    others = [item for item in requested_effects(model) if item.name != effect.name]
    repaired = repaired_takes(takes, others)
    found = effect.proposed(recorded(model, repaired))
    if found is None and effect.comparison is not None:
        found = _by_comparison(model, repaired, effect, cancelled, limits)
    if found is None:
        raise BadInput(
            f"effect {effect.name!r}: nothing of it is found in these {len(takes)} takes that adding it mends"
        )
    return found


def recorded(
    model: CalibrationModel, takes: Sequence[Take], found_before: FoundBefore | None = None
) -> Recorded:
    """Takes as effects look at them by their signature."""
    sensor_of = own_sensors(model.layout, trained_rotations(model))
    known = known_effects(model)

    def static() -> list[np.ndarray]:
        return static_errors(takes, sensor_of, known)

    return Recorded(tuple(takes), sensor_of, static, are_held_levels(takes), found_before or FoundBefore())


def _looked_for(
    model: CalibrationModel,
    takes: Sequence[Take],
    kind: type[SignatureEffect],
    without: Set[str],
    found_before: FoundBefore | None,
) -> list[Proposed]:
    if are_pose_labels(takes):
        return []
    found, looked_at = [], recorded(model, takes, found_before)
    for name, effect in catalogue().items():
        if isinstance(effect, kind) and name not in without:
            proposal = effect.proposed(looked_at)
            if proposal is not None:
                found.append(Proposed(name, proposal))
    return found


def _by_comparison(
    model: CalibrationModel,
    takes: Sequence[Take],
    effect: SignatureEffect,
    cancelled: Cancel | None,
    limits: DiagnosisLimits,
) -> Proposal | None:
    found = (
        ModelOnTakes.of_repaired(model, takes)
        .without(effect.name, *relations().alike_to(effect.name))
        .diagnosed(
            effects=[effect],
            signatures=False,
            limits=limits,
            cancelled=cancelled,
        )
    )
    assessed = next((item for item in found.assessments if item.effect == effect.name), None)
    if assessed is None or effect.comparison is None:
        return None
    constants = effect.comparison.constants(assessed, [take.name for take in takes])
    return None if constants is None else Proposal(constants)


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
    has, lineage = requested_effects(model), Lineage(parent_id, tuple(take_hashes))
    if constants is None and isinstance(effect, SignatureEffect):
        proposal = proposed(model, takes, effect, rotations, cancelled, limits.diagnosis)
        constants, rotations = proposal.constants, proposal.rotations or rotations
    chosen = _chosen(model, effect, rotations)
    fresh = EffectRequest(effect, chosen, dict(constants or {}))
    wanted = (*(item for item in has if item.name != name), _joined(has, fresh))
    prepared = PreparedTakes.of(repaired_takes(takes, wanted), model.layout)
    if isinstance(effect, IntervalEffect):
        return add_interval(
            model, effect, fresh, has, prepared, settings, lineage=lineage, limits=limits, cancelled=cancelled
        )  # fmt: skip
    if isinstance(effect, CorrectionEffect):
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
    if isinstance(effect, CorrectionEffect) and (has_form or control_share is None):
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
    if isinstance(effect, RepairEffect) and effect.live is not None:
        fresh, live = _acting_live(model, takes, has, fresh, effect.live, cancelled)
        wanted = (*(item for item in has if item.name != name), _joined(has, fresh))
    fit = with_leads(fit, prepared, settings)
    evidence = _evidence(before, after, chosen, control_share) | dict(live.evidence if live else {})
    effects = [*kept_lanes(model.effects, chosen), *fit.effects, *columnless_effects(wanted, model.effects)]
    effects = [replace(item, evidence=evidence) if item.name == name else item for item in effects]
    whole = before.with_those_of(after)
    child = child_model(model, lineage, prepared, fit, effects, whole, settings, wanted, cancelled)
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
    chosen = tuple(every if rotations is None or isinstance(effect, RepairEffect) else rotations)
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
    acts: LiveRepair,
    cancelled: Cancel | None,
) -> tuple[EffectRequest, LiveCheck]:
    """The effect with what it needs to act on live frames."""
    others = repaired_takes(takes, [item for item in has if item.name != fresh.name])
    trained = trained_rotations(model)
    reads = {
        item.rotation: item.correspondence.sensors for item in model.rotations if item.rotation in trained
    }
    sensor_of = own_sensors(model.layout, trained)
    live = acts.checked_live(others, sensor_of, model.layout.sensors, reads, cancelled)
    return replace(fresh, settings=fresh.settings | live.settings), live


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
    return replace(request, settings=mine.correction.further.with_found(request.settings, mine.settings))


def _require_judgeable(takes: PreparedTakes, why: str | None, name: str) -> None:
    if why is not None:
        raise BadInput(f"effect {name!r} cannot be learned from these {len(takes.takes)} takes: {why}")


def _all_signals(takes: PreparedTakes) -> list[Signals]:
    """Signals of all joints as measured, to ask whether an effect can be judged at all."""
    own = [np.where(np.isfinite(part), part, 0.0) for part in takes.reference]
    return takes.signals(own, np.zeros(own[0].shape[1]), frozenset())
