"""From the takes of a guided sampling to a calibration, as Wang & Neff 2013 does it in two passes.

First pass: takes with known angles. Through that model it is judged which touches happened. Second pass:
all samples, those of the touches with angles under which all touches of the session close together
(``touch_posterior.py``). With takes of one kind only (section 8.2) the other pass falls away: without known
angles the first calibration is the sensors' range put on the joints' (section 5.2.2).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.samples import require_layout
from glovecal_models.calibration.training import train
from glovecal_models.calibration.training_settings import Report, TrainingSettings
from glovecal_models.errors import Cancelled, NotTrainable
from glovecal_models.guided.closing_touches import closing_touches
from glovecal_models.guided.first_beliefs import first_beliefs, reading_ranges
from glovecal_models.guided.second_pass import (
    Lesson,
    SampleCount,
    counted,
    known_lessons,
    taught_layout,
    touch_lessons,
    with_open_variance,
)
from glovecal_models.guided.seen_touches import RefusedTouch, SeenTouch, seen_touches
from glovecal_models.guided.sentences import guided_sentences, hold_sentence, nothing_left
from glovecal_models.guided.taught_samples import hold_sd_deg, taught_samples
from glovecal_models.guided.taught_take import FK, TaughtTake
from glovecal_models.guided.touch_posterior import TouchPosterior
from glovecal_models.hand.skeleton import Skeleton
from glovecal_models.layout import Layout
from glovecal_models.takes.take import Take

SAMPLES_SHARE = 0.3
"""Of the work that goes before the training."""


@dataclass(frozen=True)
class GuidedSamples:
    """What a sampling teaches, ready for training; a service may spread the fits and call ``finished``."""

    takes: tuple[Take, ...]
    """With the angles of the second pass."""
    layout: Layout
    """To train by: the glove's own but for joints without a sensor."""
    glove_layout: Layout
    samples: tuple[SampleCount, ...]
    refused: tuple[RefusedTouch, ...]
    sentences: tuple[str, ...]
    lessons: tuple[Lesson, ...]
    posterior: TouchPosterior
    """The likeliest calibration before any training."""

    def finished(self, model: CalibrationModel) -> CalibrationModel:
        """A ``model`` trained on ``takes`` by ``layout``, as it is to be kept."""
        return with_open_variance(replace(model, layout=self.glove_layout), self.lessons, self.posterior)


@dataclass(frozen=True)
class GuidedCalibration:
    model: CalibrationModel
    samples: tuple[SampleCount, ...]
    refused: tuple[RefusedTouch, ...]
    sentences: tuple[str, ...]


def guided_samples(
    takes: Sequence[TaughtTake],
    layout: Layout,
    skeleton: Skeleton | None,
    *,
    cancelled: Callable[[], bool] | None = None,
    report: Report | None = None,
) -> GuidedSamples:
    """Both passes but for the training; see ``guided_calibration``. Raises as it does."""
    say = report or (lambda sentence, fraction: None)
    for taught in takes:
        require_layout(taught.take, layout)
    used = [_in_order(taught, layout) for taught in takes]
    known = [taught for taught in used if taught.kind in FK]
    touching = [taught for taught in used if taught.contacts]
    if not known and not touching:
        raise NotTrainable(nothing_left(skeleton is not None, 0, ()))
    say("what poses and widgets tell", 0.0)
    samples = taught_samples(used)
    readings = np.concatenate([taught.take.readings[taught.take.lead_in_frames :] for taught in used])
    beliefs = first_beliefs(layout, samples, reading_ranges(layout.sensors, readings))
    seen: list[SeenTouch] = []
    refused: list[RefusedTouch] = []
    if touching and skeleton is not None:
        say("first pass: which touches can be seen in what poses and widgets taught", 0.1)
        first = TouchPosterior(beliefs, layout.sensors, skeleton, ())
        seen, refused = seen_touches(touching, first, skeleton)
        _stop_if(cancelled)
    say("what all touches tell together", 0.5)
    posterior = TouchPosterior(beliefs, layout.sensors, skeleton, (), cancelled)
    if seen and skeleton is not None:
        posterior, seen, strange = closing_touches(beliefs, layout.sensors, skeleton, seen, cancelled)
        refused += strange
    inferred, told = touch_lessons(seen, posterior, layout.rotations)
    lessons = (*known_lessons(known, posterior), *inferred)
    if not lessons:
        raise NotTrainable(nothing_left(skeleton is not None, len(touching), refused))
    said = [hold_sentence(len(samples.holds), hold_sd_deg(samples, layout))] if samples.holds else []
    said += guided_sentences(seen, refused, told, posterior, skeleton)
    say("second pass: all samples have their angles", 1.0)
    return GuidedSamples(
        takes=tuple(lesson.take for lesson in lessons),
        layout=taught_layout(layout, told),
        glove_layout=layout,
        samples=counted(lessons, told),
        refused=tuple(refused),
        sentences=tuple(said),
        lessons=lessons,
        posterior=posterior,
    )


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
    how = {"take_hashes": take_hashes, "parent": parent, "cancelled": cancelled}
    if settings.method in ("raw", "linear"):
        return _plain(takes, layout, subject, settings, report=report, **how)
    say = report or (lambda sentence, fraction: None)

    def first(sentence: str, fraction: float) -> None:
        say(sentence, SAMPLES_SHARE * fraction)

    def then(sentence: str, fraction: float) -> None:
        say(f"second pass: {sentence}", SAMPLES_SHARE + (1 - SAMPLES_SHARE) * fraction)

    found = guided_samples(takes, layout, skeleton, cancelled=cancelled, report=first)
    model = found.finished(train(found.takes, found.layout, subject, settings, report=then, **how))
    say("trained", 1.0)
    return GuidedCalibration(model, found.samples, found.refused, found.sentences)


def _plain(
    takes: Sequence[TaughtTake], layout: Layout, subject: str, settings: TrainingSettings, **how: Any
) -> GuidedCalibration:
    """A baseline: known angles as they are."""
    known = [taught for taught in takes if taught.kind in FK and taught.take.rotations]
    if not known:
        raise NotTrainable(f"method {settings.method} needs poses or widgets; touches are not used by it")
    model = train([taught.take for taught in known], layout, subject, settings, **how)
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


def _in_order(taught: TaughtTake, layout: Layout) -> TaughtTake:
    """The layout's sensors alone, in its order."""
    take = taught.take
    columns = [take.sensors.index(name) for name in layout.sensors]
    ordered = replace(take, sensors=layout.sensors, readings=take.readings[:, columns])
    return replace(taught, take=ordered)


def _stop_if(cancelled: Callable[[], bool] | None) -> None:
    if cancelled is not None and cancelled():
        raise Cancelled("training was cancelled")
