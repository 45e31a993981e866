"""Effects known by a signature in the recording, asked in the order in which they mislead others."""

from __future__ import annotations

from collections.abc import Iterator, Sequence, Set
from dataclasses import replace

import numpy as np

from glovecal_models.calibration.left_out import held_levels
from glovecal_models.diagnosis.assessment import LEAST_SESSION_CONTRAST, Assessment
from glovecal_models.diagnosis.naming import Naming
from glovecal_models.effects.base.signature_effect import Finding, SignatureEffect
from glovecal_models.effects.catalogue import catalogue
from glovecal_models.layout import Layout
from glovecal_models.takes.take import Take

BEFORE_ALL = ("repeated_samples", "sensor_fault", "saturation")
AFTER_ALL = ("garment_slip",)
"""Creep looks like a slip: only asked when nothing else explains the error."""
SLIP_TOO = ("donning_shift", "temperature", "humidity", "warmup_drift", "supply_sag")
"""A walk over minutes differs between wearings, and goes along with one slow column or other, by chance."""
CHANCE_SHARE = 0.55
"""Of the squared error: a true cause of those saves more at 1.3 noise floors, a walk lends them less."""


def may_be_slip(naming: Naming) -> bool:
    """Whether nothing is ranked but what a slip brings about too, and that explains about half at most."""
    if not naming.ranked:
        return True
    first = naming.ranked[0]
    share = np.mean([first.errors[joint].contrast for joint in first.touched])
    return all(item.effect in SLIP_TOO for item in naming.ranked) and bool(share < CHANCE_SHARE)


def own_sensors(layout: Layout, joints: Sequence[str]) -> dict[str, str]:
    """The measuring sensor of each joint that has one."""
    found = {}
    for name in joints:
        item = layout.correspondence(name)
        if item.simulated is None and (item.rotation in item.sensors or len(item.sensors) == 1):
            found[name] = item.sensors[item.sensors.index(name)] if name in item.sensors else item.sensors[0]
    return found


def signature_findings(
    takes: Sequence[Take],
    layout: Layout,
    joints: Sequence[str],
    naming: Naming,
    assessments: Sequence[Assessment],
    without: Set[str] = frozenset(),
) -> Iterator[Finding]:
    """Largest first within each effect; ``without`` names effects that the model has already."""
    sensor_of = own_sensors(layout, joints)
    if not sensor_of:
        return
    if are_held_levels(takes):
        faults = _found("sensor_fault", takes, sensor_of, None)
        yield from (_between_levels(item, takes, sensor_of) for item in faults if item.kind == "jump")
        return
    for name in (name for name in BEFORE_ALL if name not in without):
        yield from _found(name, takes, sensor_of, None)
    if may_be_slip(naming):
        plausible = _with_plausible_context(takes, assessments)
        for name in (name for name in AFTER_ALL if name not in without):
            yield from _found(name, plausible, sensor_of, static_errors(takes, sensor_of))


def are_held_levels(takes: Sequence[Take]) -> bool:
    """Whether all takes only hold one angle after another: there nothing moves, and repeats mean nothing."""
    return bool(takes) and all(held_levels(take.reference) is not None for take in takes)


def jump_beside_curve(naming: Naming, takes: Sequence[Take], findings: Sequence[Finding]) -> Naming:
    """One pass over known angles cannot tell a curve from a sensor that moved half-way: both are named."""
    first = naming.ranked[0].effect if naming.ranked else None
    if not findings or not are_held_levels(takes):
        return naming
    if first is None:
        return replace(naming, confidence_set=("sensor_fault", "nonlinearity"))
    if first != "nonlinearity":
        return naming
    return replace(naming, confidence_set=(*naming.confidence_set, "sensor_fault"))


def _between_levels(item: Finding, takes: Sequence[Take], sensor_of: dict[str, str]) -> Finding:
    """The jump, with the known angles it lies between, and what it cannot be told from."""
    at = item.stretches[0]
    take = next(take for take in takes if take.name == at.take)
    rotation = next(name for name, sensor in sensor_of.items() if sensor in item.where)
    angle = take.reference_at_frames([rotation])[:, 0]
    row = int(np.searchsorted(take.time_s, at.start_s))
    before = angle[:row][angle[:row] != angle[row]]
    if not len(before):
        return item
    sentence = (
        f"{item.where[0]} may jump between {before[-1]:g} and {angle[row]:g} degrees of {rotation}, by"
        f" {item.size_deg or 0.0:.0f} degrees: one pass over known angles cannot tell that from a curved"
        " sensor."
    )
    return replace(item, sentence=sentence)


def _found(
    name: str, takes: Sequence[Take], sensor_of: dict[str, str], errors: Sequence[np.ndarray] | None
) -> tuple[Finding, ...]:
    effect = catalogue().get(name)
    return effect.find(takes, sensor_of, errors) if isinstance(effect, SignatureEffect) else ()


def _context_of(name: str) -> tuple[str, ...]:
    known = catalogue().get(name)
    return known.context if known is not None else ()


def _with_plausible_context(takes: Sequence[Take], assessments: Sequence[Assessment]) -> list[Take]:
    """Without the context columns that save too little: takes are few, and each column uses one up."""
    saving = [item for item in assessments if max(e.contrast for e in item.errors) >= LEAST_SESSION_CONTRAST]
    kept = {name for item in saving for name in _context_of(item.effect)}
    return [
        replace(take, context={name: values for name, values in take.context.items() if name in kept})
        for take in takes
    ]


def static_errors(takes: Sequence[Take], sensor_of: dict[str, str]) -> list[np.ndarray]:
    """For each take (N, joints): what a smooth curve of each joint's own sensor leaves, degrees."""
    result = [np.full((len(take.time_s), len(sensor_of)), np.nan) for take in takes]
    for column, (rotation, sensor) in enumerate(sensor_of.items()):
        x = [take.readings[:, take.sensors.index(sensor)] for take in takes]
        y = [take.reference_at_frames([rotation])[:, 0] for take in takes]
        every, target = np.concatenate(x), np.concatenate(y)
        known = np.isfinite(target)
        if known.sum() < 50 or np.ptp(every[known]) == 0:
            continue
        low, span = float(every.min()), max(float(np.ptp(every)), 1e-9)
        columns = np.polynomial.legendre.legvander(2 * (every[known] - low) / span - 1, 7)
        curve = np.linalg.lstsq(columns, target[known], rcond=None)[0]
        for part, reading, angle in zip(result, x, y, strict=True):
            part[:, column] = np.polynomial.legendre.legval(2 * (reading - low) / span - 1, curve) - angle
    return result
