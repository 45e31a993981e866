"""Training takes of the second pass: what was known beforehand and what touches tell, on the same readings.

Every frame gets the angle that the likeliest calibration of the whole session reads there. A widget's own
four angles would teach a process a staircase: readings scatter about each step while the angle does not, and
the likeliest process is flat there. So the noise goes where it does no harm (Berkson 1950): the angle is what
the calibration reads from the frame as it came, the readings are those without the noise. The map keeps its
slope, and the noise that a process learns is that of a live frame.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from glovecal_models.calibration.model import CalibrationModel, RotationModel
from glovecal_models.calibration.training import uncertain_above
from glovecal_models.inverse_kinematics.steadied import steadied
from glovecal_models.layout import Correspondence, Layout
from glovecal_models.regression.linear_regressor import LinearRegressor
from glovecal_models.regression.process_regressor import ProcessRegressor
from glovecal_models.sampling.guided.labelled_takes import LabelledTake
from glovecal_models.sampling.guided.seen_touches import SeenTouch
from glovecal_models.sampling.guided.touch_posterior import TouchPosterior
from glovecal_models.sampling.protocol import Kind
from glovecal_models.takes.take import Take

LOOKED_AT = 40
"""Frames of a take that stand for all."""
LEAST_TOLD = 0.05
"""Of what was not known of a joint; a touch that tells less only repeats the calibration."""


@dataclass(frozen=True)
class SampleCount:
    """Of one rotation, from one kind of take."""

    rotation: str
    kind: Kind
    samples: int
    told: float | None = None
    """IK: the share of what was not known before that the touches told, 0 to 1."""


@dataclass(frozen=True)
class LabelledSamples:
    """A take to train on: readings without noise, angles of the likeliest calibration."""

    take: Take
    kind: Kind
    ruled: tuple[str, ...] = ()
    """Rotations that nobody knows here but by rule: they keep a map from going astray between touches."""


def known_samples(
    takes: Iterable[LabelledTake], posterior: TouchPosterior, told: Iterable[str] = ()
) -> list[LabelledSamples]:
    """From takes with known angles. In held poses also joints without a sensor that touches ``told`` of: a
    straight finger is straight, and no touch shows that."""
    ruled = tuple(name for name in told if posterior.priors[name].prior.follows)
    labelled_samples = []
    for labelled in takes:
        if not labelled.take.rotations or labelled.kind not in ("fk_independent", "fk_cross_couple"):
            continue
        take, smooth = labelled.take, steadied(labelled.take.time_s, labelled.take.readings.astype(float))
        reference = _as_read(take, posterior)
        if labelled.kind == "fk_independent" and ruled:
            held = np.asarray(np.isfinite(reference).any(axis=1))
            column = np.full((len(held), len(ruled)), np.nan)
            for index, name in enumerate(ruled):
                column[held, index] = posterior.angles(name, take.readings[held])
            names, reference = (*take.rotations, *ruled), np.hstack([reference, column])
            labelled_samples.append(_labelled_samples(take, smooth, names, reference, labelled.kind, ruled))
            continue
        labelled_samples.append(_labelled_samples(take, smooth, take.rotations, reference, labelled.kind))
    return labelled_samples


def touch_samples(
    seen: Sequence[SeenTouch], posterior: TouchPosterior, rotations: Sequence[str]
) -> tuple[list[LabelledSamples], dict[str, float]]:
    """From touches, those of ``rotations`` that each tells something of; and the share told of each."""
    labelled_samples: list[LabelledSamples] = []
    told: dict[str, float] = {}
    for touch in seen:
        some = touch.some(LOOKED_AT).readings
        shares = {name: posterior.told(name, some) for name in touch.rotations if name in rotations}
        names = tuple(name for name, share in shares.items() if share >= LEAST_TOLD)
        reference = np.full((len(touch.take.time_s), len(names)), np.nan)
        for column, name in enumerate(names):
            reference[touch.rows, column] = posterior.angles(name, touch.take.readings[touch.rows])
            told[name] = max(told.get(name, 0.0), shares[name])
        smooth = touch.take.readings.astype(float)
        smooth[touch.rows] = touch.readings
        if names:
            labelled_samples.append(_labelled_samples(touch.take, smooth, names, reference, "ik"))
    return labelled_samples, told


def counted(labelled_samples: Iterable[LabelledSamples], told: dict[str, float]) -> tuple[SampleCount, ...]:
    counts: dict[tuple[str, Kind], int] = {}
    for one in labelled_samples:
        for column, name in enumerate(one.take.rotations):
            if name in one.ruled:
                continue
            count = int(np.isfinite(one.take.reference[:, column]).sum())
            counts[name, one.kind] = counts.get((name, one.kind), 0) + count
    return tuple(
        SampleCount(name, kind, count, told.get(name) if kind == "ik" else None)
        for (name, kind), count in counts.items()
        if count
    )


def labelled_layout(layout: Layout, told: Iterable[str]) -> Layout:
    """A joint without a sensor that touches tell of is read from all sensors of its rule, not from one fixed
    mixture of them: nobody told the mixture."""
    items = [
        Correspondence(item.rotation, "MS1R", item.sensors)
        if item.simulated is not None and item.rotation in told
        else item
        for item in layout.correspondences
    ]
    return replace(layout, correspondences=tuple(items))


def with_open_variance(
    model: CalibrationModel, labelled_samples: Sequence[LabelledSamples], posterior: TouchPosterior
) -> CalibrationModel:
    """The model claiming, beside the noise of a frame, what the session left open."""
    return replace(
        model, rotations=tuple(_claiming(item, labelled_samples, posterior) for item in model.rotations)
    )


def _claiming(
    item: RotationModel, labelled_samples: Sequence[LabelledSamples], posterior: TouchPosterior
) -> RotationModel:
    regressor = item.regressor
    if not isinstance(regressor, LinearRegressor | ProcessRegressor):
        return item  # a rule has the noise of what it follows
    left = [np.empty(0)]
    for one in labelled_samples:
        if item.rotation in one.take.rotations:
            angle = one.take.reference[:, one.take.rotations.index(item.rotation)]
            some = one.take.readings[np.isfinite(angle)]
            left.append(posterior.variance(item.rotation, some[:: max(1, len(some) // LOOKED_AT)]))
    variance = regressor.noise_variance + float(np.concatenate(left).mean())
    claiming = replace(regressor, noise_variance=variance)
    return replace(item, regressor=claiming, uncertain_above_deg=uncertain_above(variance))


def _as_read(take: Take, posterior: TouchPosterior) -> np.ndarray:
    """(N, R): what the likeliest calibration reads where an angle is known."""
    found = take.reference_at_frames(take.rotations)
    for column, name in enumerate(take.rotations):
        known = np.isfinite(found[:, column])
        found[known, column] = posterior.angles(name, take.readings[known])
    return found


def _labelled_samples(
    take: Take,
    readings: np.ndarray,
    rotations: tuple[str, ...],
    reference: np.ndarray,
    kind: Kind,
    ruled: tuple[str, ...] = (),
) -> LabelledSamples:
    labelled = replace(
        take, readings=readings, rotations=rotations, reference_time_s=take.time_s, reference=reference
    )
    return LabelledSamples(labelled, kind, ruled)
