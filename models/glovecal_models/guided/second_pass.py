"""Training takes of the second pass: what was known beforehand and what touches tell, on the same readings.

Every frame gets the angle that the likeliest calibration of the whole session reads there. A widget's own
four angles would teach a process a staircase: readings scatter about each step while the angle does not, and
the likeliest process is flat there. Readings are without the sensors' noise, which would flatten every map a
little; how far a single live frame is off is measured afterwards, on the readings as they came.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from glovecal_models.calibration.model import CalibrationModel, RotationModel
from glovecal_models.calibration.training import uncertain_above
from glovecal_models.guided.seen_touches import SeenTouch
from glovecal_models.guided.taught_take import TaughtTake
from glovecal_models.guided.touch_posterior import TouchPosterior
from glovecal_models.inverse_kinematics.steadied import steadied
from glovecal_models.layout import Correspondence, Layout
from glovecal_models.regression.rule_regressor import RuleRegressor
from glovecal_models.sampling.step import Kind
from glovecal_models.takes.take import Take

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
class Lesson:
    """A take to train on, and the readings as they came."""

    take: Take
    """Readings without noise, angles known or inferred."""
    raw: np.ndarray
    kind: Kind


def known_lessons(takes: Iterable[TaughtTake], posterior: TouchPosterior) -> list[Lesson]:
    """From takes with known angles."""
    lessons = []
    for taught in takes:
        if not taught.take.rotations or taught.kind not in ("fk_independent", "fk_cross_couple"):
            continue
        take, smooth = taught.take, steadied(taught.take.time_s, taught.take.readings.astype(float))
        reference = _as_read(take.reference_at_frames(take.rotations), take.rotations, smooth, posterior)
        lessons.append(_lesson(take, smooth, take.rotations, reference, taught.kind))
    return lessons


def touch_lessons(
    seen: Sequence[SeenTouch], posterior: TouchPosterior, rotations: Sequence[str]
) -> tuple[list[Lesson], dict[str, float]]:
    """From touches, those of ``rotations`` that each tells something of; and the share told of each."""
    lessons: list[Lesson] = []
    told: dict[str, float] = {}
    for touch in seen:
        some = touch.some(40).readings
        shares = {name: posterior.told(name, some) for name in touch.rotations if name in rotations}
        names = tuple(name for name, share in shares.items() if share >= LEAST_TOLD)
        reference = np.full((len(touch.take.time_s), len(names)), np.nan)
        for column, name in enumerate(names):
            reference[touch.rows, column] = posterior.angles(name, touch.readings)
            told[name] = max(told.get(name, 0.0), shares[name])
        smooth = touch.take.readings.astype(float)
        smooth[touch.rows] = touch.readings
        if names:
            lessons.append(_lesson(touch.take, smooth, names, reference, "ik"))
    return lessons, told


def counted(lessons: Iterable[Lesson], told: dict[str, float]) -> tuple[SampleCount, ...]:
    counts: dict[tuple[str, Kind], int] = {}
    for lesson in lessons:
        for column, name in enumerate(lesson.take.rotations):
            count = int(np.isfinite(lesson.take.reference[:, column]).sum())
            counts[name, lesson.kind] = counts.get((name, lesson.kind), 0) + count
    return tuple(
        SampleCount(name, kind, count, told.get(name) if kind == "ik" else None)
        for (name, kind), count in counts.items()
        if count
    )


def taught_layout(layout: Layout, told: Iterable[str]) -> Layout:
    """A joint without a sensor that touches tell of is read from all sensors of its rule, not from one fixed
    mixture of them: nobody told the mixture."""
    items = [
        Correspondence(item.rotation, "MS1R", item.sensors)
        if item.simulated is not None and item.rotation in told
        else item
        for item in layout.correspondences
    ]
    return replace(layout, correspondences=tuple(items))


def with_live_noise(
    model: CalibrationModel, lessons: Sequence[Lesson], posterior: TouchPosterior
) -> CalibrationModel:
    """The model claiming what a single frame is off by as it came, and what the session left open."""
    return replace(model, rotations=tuple(_claiming(item, lessons, posterior) for item in model.rotations))


def _claiming(item: RotationModel, lessons: Sequence[Lesson], posterior: TouchPosterior) -> RotationModel:
    if isinstance(item.regressor, RuleRegressor):
        return item
    squared, open_variance = [np.empty(0)], [np.empty(0)]
    for lesson in lessons:
        if item.rotation not in lesson.take.rotations:
            continue
        angle = lesson.take.reference[:, lesson.take.rotations.index(item.rotation)]
        known = np.isfinite(angle)
        read = item.regressor.predict(
            item.correspondence.input_columns(lesson.raw[known], lesson.take.sensors)
        )
        squared.append((read.mean - angle[known]) ** 2)
        some = lesson.take.readings[known][:: max(1, int(known.sum()) // 20)]
        if lesson.kind != "fk_cross_couple":
            open_variance.append(posterior.variance(item.rotation, some))
    variance = float(np.concatenate(squared).mean())
    unknown = np.concatenate(open_variance)
    variance = max(item.regressor.noise_variance, variance + (float(unknown.mean()) if len(unknown) else 0.0))
    regressor = replace(item.regressor, noise_variance=variance)  # type: ignore[type-var]
    return replace(item, regressor=regressor, uncertain_above_deg=uncertain_above(variance))


def _as_read(
    reference: np.ndarray, rotations: Sequence[str], readings: np.ndarray, posterior: TouchPosterior
) -> np.ndarray:
    found = reference.copy()
    for column, name in enumerate(rotations):
        known = np.isfinite(reference[:, column])
        found[known, column] = posterior.angles(name, readings[known])
    return found


def _lesson(
    take: Take, readings: np.ndarray, rotations: tuple[str, ...], reference: np.ndarray, kind: Kind
) -> Lesson:
    taught = replace(
        take, readings=readings, rotations=rotations, reference_time_s=take.time_s, reference=reference
    )
    return Lesson(taught, take.readings.astype(float), kind)
