"""From the takes of a guided sampling to a calibration: its lessons, and a regressor trained on them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.training import train
from glovecal_models.calibration.training_settings import Report, TrainingSettings
from glovecal_models.errors import NotTrainable
from glovecal_models.guided.guided_lessons import GuidedLessons, guided_lessons, known_of
from glovecal_models.guided.left_out import LeftOut
from glovecal_models.guided.second_pass import SampleCount, counted, with_live_noise
from glovecal_models.guided.seen_touches import RefusedTouch
from glovecal_models.guided.taught_samples import taught_samples
from glovecal_models.guided.taught_take import FK, TaughtTake
from glovecal_models.hand.skeleton import Skeleton
from glovecal_models.layout import Layout

BASELINES = ("raw", "linear")
"""Methods that take known angles as they are, and no touches."""
HELD_OUT = "widgets left out, one at a time"


@dataclass(frozen=True)
class GuidedCalibration:
    model: CalibrationModel
    samples: tuple[SampleCount, ...]
    refused: tuple[RefusedTouch, ...]
    sentences: tuple[str, ...]


def guided_calibration(
    takes: Sequence[TaughtTake],
    layout: Layout,
    subject: str,
    skeleton: Skeleton | None,
    settings: TrainingSettings | None = None,
    *,
    take_hashes: Sequence[str] = (),
    parent: str | None = None,
    cancelled: Callable[[], bool] | None = None,
    report: Report | None = None,
) -> GuidedCalibration:
    """Train on the takes of one or several samplings of a subject, whose hand is ``skeleton``.

    Without a skeleton, and for the methods ``raw`` and ``linear``, touches are not used. Takes of kinds
    ``range`` and ``verification`` only show the sensors' range. Raises NotTrainable where nothing is left to
    train on, with the reason of every touch that was refused, LayoutMismatch, Cancelled.
    """
    settings = settings or TrainingSettings()
    say = report or (lambda sentence, fraction: None)
    if settings.method in BASELINES:
        how = {"take_hashes": take_hashes, "parent": parent, "cancelled": cancelled, "report": report}
        return _plain(known_of(takes), layout, subject, settings, **how)
    lessons = guided_lessons(
        takes, layout, skeleton, cancelled=cancelled,
        report=lambda sentence, fraction: say(sentence, 0.5 * fraction),
    )  # fmt: skip
    say("second pass: training on all samples", 0.5)
    model = train(
        lessons.takes,
        lessons.layout,
        subject,
        replace(settings, folds=0),
        take_hashes=take_hashes,
        parent=parent,
        cancelled=cancelled,
        report=lambda sentence, fraction: say(sentence, 0.5 + 0.5 * fraction),
    )
    say("trained", 1.0)
    return finished(lessons, model, layout)


def finished(lessons: GuidedLessons, model: CalibrationModel, layout: Layout) -> GuidedCalibration:
    """``model``, trained on the lessons' takes, claiming what a live frame is off by.

    Without an error estimate of its own it gets that of ``left_out.py``.
    """
    model = with_live_noise(replace(model, layout=layout), lessons.lessons, lessons.posterior)
    if "rmse_deg" not in model.error_estimate:
        model = _with_estimate(model, lessons.without)
    samples = counted(lessons.lessons, lessons.told)
    return GuidedCalibration(model, samples, lessons.refused, lessons.sentences)


def _with_estimate(model: CalibrationModel, without: LeftOut) -> CalibrationModel:
    estimate: dict[str, Any] = {"how": HELD_OUT, "folds": 0, "touch_mm": without.touch_mm}
    if without.rmse_deg is not None:
        estimate["rmse_deg"] = without.rmse_deg
    errors = without.widget_rmse_deg
    rotations = (replace(item, held_out_rmse_deg=errors.get(item.rotation)) for item in model.rotations)
    return replace(model, rotations=tuple(rotations), error_estimate=estimate)


def _plain(
    known: Sequence[TaughtTake],
    layout: Layout,
    subject: str,
    settings: TrainingSettings,
    **how: Any,
) -> GuidedCalibration:
    """A baseline: known angles as they are."""
    takes = [taught.take for taught in known if taught.take.rotations]
    if not takes:
        raise NotTrainable(f"method {settings.method} needs poses or widgets; touches are not used by it")
    model = train(takes, layout, subject, settings, **how)
    samples = taught_samples(known)
    counts = [
        SampleCount(
            name,
            kind,
            sum(
                len(rows)
                for taught in known
                if taught.kind == kind and name in taught.take.rotations
                for rows in taught.steps()
            ),
        )
        for name in samples.rotations
        for kind in FK
    ]
    said = f"Trained by method {settings.method}, which takes known angles as they are and no touches."
    return GuidedCalibration(model, tuple(item for item in counts if item.samples), (), (said,))
