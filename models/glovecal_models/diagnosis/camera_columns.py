"""Columns of what a reference with stated deviations gets wrong itself.

A camera that is unsure leans to what it expects: to the middle of a joint's range, or to what the other
joints let it expect. So a part of its errors goes along with the stated deviation times its angle, or times
what a linear prior makes of the others, and with how much of the hand it sees.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal

import numpy as np

from glovecal_models.diagnosis.known_effect import KnownColumns
from glovecal_models.diagnosis.resampled import ResampledTake
from glovecal_models.takes.camera_reference import CAMERA_PATCHES

CameraPart = Literal["varying", "whole", "control", "none"]
"""Of what a camera gets wrong, which belongs to the base: what varies with its stated deviation; all that
goes along with it, the part that is the same at every deviation included, which an effect of the glove may
look like; the control of the first; nothing."""
LEAN_SHARE = 0.3
"""Prior standard deviation of each weight: the part of the stated deviation that goes along with one
angle."""


def camera_columns(
    takes: Sequence[ResampledTake], angles: Sequence[np.ndarray], joint: int, part: CameraPart
) -> KnownColumns | None:
    """Of one joint; ``angles``: for each take (N, R), degrees, without gaps. None where no deviation is
    stated."""
    if all(take.reference_sd is None or not np.isfinite(take.reference_sd[:, joint]).any() for take in takes):
        return None
    every = np.concatenate(list(angles))
    centre, spread = every.mean(axis=0), np.maximum(every.std(axis=0), 1e-9)
    late = part == "control"
    deviations = [_rolled(_stated(take, joint), late) for take in takes]
    usual = float(np.sqrt(np.mean(np.concatenate(deviations) ** 2)))
    if part != "whole":
        middle = float(np.concatenate(deviations).mean())
        deviations = [deviation - middle for deviation in deviations]
    seen = [_rolled(take.context[CAMERA_PATCHES], late) for take in takes if CAMERA_PATCHES in take.context]
    expected = _expected(every, joint)
    parts = []
    for number, (values, deviation) in enumerate(zip(angles, deviations, strict=True)):
        z = (values - centre) / spread
        own = z[:, joint]
        leaning = (np.ones(len(own)), own, own**2 - 1.0, z @ expected)
        columns = [deviation * item for item in leaning]
        if len(seen) == len(takes):
            patches = usual * _standard(seen, number)
            columns += [patches * item for item in leaning]
        parts.append(np.column_stack(columns))
    return KnownColumns(parts, np.full(parts[0].shape[1], LEAN_SHARE))


def _expected(angles: np.ndarray, joint: int) -> np.ndarray:
    """(R,) weights of standardised angles (N, R): what the others, as a linear prior, let one joint
    expect."""
    correlation = np.corrcoef(angles.T).reshape(angles.shape[1], angles.shape[1])
    correlation = np.nan_to_num(correlation)
    others = np.flatnonzero(np.arange(len(correlation)) != joint)
    found = np.zeros(len(correlation))
    inner = correlation[np.ix_(others, others)] + 0.1 * np.eye(len(others))
    found[others] = np.linalg.solve(inner, correlation[others, joint])
    return found / max(float(np.sqrt(found @ correlation @ found)), 1e-9)


def _stated(take: ResampledTake, joint: int) -> np.ndarray:
    """(N,) degrees: across gaps by straight lines, 0 where the take states none."""
    if take.reference_sd is None:
        return np.zeros(len(take.time_s))
    known = np.flatnonzero(np.isfinite(take.reference_sd[:, joint]))
    if not len(known):
        return np.zeros(len(take.time_s))
    return np.interp(np.arange(len(take.time_s)), known, take.reference_sd[known, joint])


def _standard(parts: Sequence[np.ndarray], number: int) -> np.ndarray:
    every = np.concatenate(list(parts))
    return (parts[number] - every.mean()) / max(float(every.std()), 1e-9)


def _rolled(values: np.ndarray, late: bool) -> np.ndarray:
    return np.roll(values, len(values) // 2) if late else values


def without_visibility(take: ResampledTake) -> ResampledTake:
    """What effects of the glove may look at: how much a camera sees is no cause of theirs."""
    context = {name: values for name, values in take.context.items() if name != CAMERA_PATCHES}
    return replace(take, context=context)
