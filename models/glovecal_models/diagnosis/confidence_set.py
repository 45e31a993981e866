"""The confidence set of a ranking, widened by what a recording shows by its signature, or may hide."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from glovecal_models.diagnosis.known_effect import KnownEffect
from glovecal_models.diagnosis.naming import Naming, saved_share_of
from glovecal_models.diagnosis.signatures import (
    are_held_levels,
    by_signature,
    is_asked_beside,
    own_sensors,
    static_errors,
)
from glovecal_models.effects.base.effect import Effect
from glovecal_models.effects.base.signature_effect import Finding
from glovecal_models.layout import Layout
from glovecal_models.takes.take import Take


def beside_findings(naming: Naming, findings: Sequence[Finding], layout: Layout) -> Naming:
    """A finding that may be one of the ranked effects instead, where that saves error on the same rotations,
    and that effect are told together."""
    found = []
    for item in findings:
        rotations = {
            ranked.joints[i]
            for ranked in naming.ranked
            if ranked.effect in item.rivals and ranked.effect in naming.confidence_set
            for i in ranked.significant_joints
        }
        sensors = own_sensors(layout, sorted(rotations))
        if not rotations.union(sensors.values()).isdisjoint(item.where):
            found.append(item.effect)
    return _with(naming, found)


def beside_hidden(
    naming: Naming,
    takes: Sequence[Take],
    layout: Layout,
    lacking: Sequence[Effect],
    effects: Mapping[str, Effect],
    known: Sequence[KnownEffect] = (),
) -> Naming:
    """What may be too small to be found, and is behind the first of the ranking: both are told.

    Steps of a column, and who explains more than such an effect could let others explain, are no chance.
    ``lacking``: effects that the model does not have; ``effects``: those that were ranked, by name.
    """
    if not naming.ranked:
        return naming
    first = naming.ranked[0]
    sensor_of = own_sensors(layout, [first.joints[i] for i in first.significant_joints])
    hidden = []
    for item in by_signature(lacking, "last"):
        if item.name in naming.confidence_set or not is_asked_beside(item, naming, effects):
            continue
        if sensor_of and first.steps is None and saved_share_of(first) < item.also_explained_share:
            errors = static_errors(takes, sensor_of, known)
            if item.may_be_instead(effects[first.effect], takes, sensor_of, errors):
                hidden.append(item.name)
    return _with(naming, hidden)


def beside_levels(
    naming: Naming, takes: Sequence[Take], findings: Sequence[Finding], effects: Mapping[str, Effect]
) -> Naming:
    """One pass over known angles cannot tell what is found between them from some effects: both are named."""
    if not findings or not are_held_levels(takes):
        return naming
    found = effects[findings[0].effect]
    if not naming.ranked:
        return replace(naming, confidence_set=(found.name, *found.alike_between_levels))
    if naming.ranked[0].effect not in found.alike_between_levels:
        return naming
    return replace(naming, confidence_set=(*naming.confidence_set, found.name))


def _with(naming: Naming, names: Sequence[str]) -> Naming:
    return replace(naming, confidence_set=tuple(dict.fromkeys((*naming.confidence_set, *names))))
