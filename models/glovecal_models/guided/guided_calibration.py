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
from glovecal_models.guided.first_beliefs import first_beliefs, reading_ranges
from glovecal_models.guided.second_pass import (
    SampleCount,
    counted,
    known_lessons,
    taught_layout,
    touch_lessons,
    with_live_noise,
)
from glovecal_models.guided.seen_touches import RefusedTouch, SeenTouch, seen_touches
from glovecal_models.guided.sentences import guided_sentences, hold_sentence, nothing_left
from glovecal_models.guided.taught_samples import hold_sd_deg, taught_samples
from glovecal_models.guided.taught_take import FK, TaughtTake
from glovecal_models.guided.touch_posterior import TouchPosterior
from glovecal_models.hand.skeleton import Skeleton
from glovecal_models.layout import Layout

FRAMES_A_TOUCH = 100
"""Of each touch that the search for the likeliest calibration looks at."""


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
    for taught in takes:
        require_layout(taught.take, layout)
    known = [taught for taught in takes if taught.kind in FK]
    if settings.method in ("raw", "linear"):
        how = {"take_hashes": take_hashes, "parent": parent, "cancelled": cancelled, "report": report}
        return _plain(known, layout, subject, settings, **how)
    used = [_in_order(taught, layout) for taught in takes]
    known = [taught for taught in used if taught.kind in FK]
    say("what the poses and widgets tell", 0.0)
    samples = taught_samples(known)
    readings = np.concatenate([taught.take.readings[taught.take.lead_in_frames :] for taught in used])
    beliefs = first_beliefs(layout, samples, reading_ranges(layout.sensors, readings), cancelled)
    seen: list[SeenTouch] = []
    refused: list[RefusedTouch] = []
    touching = [taught for taught in used if taught.contacts]
    if touching and skeleton is not None:
        say("first pass: which touches can be seen in what poses and widgets taught", 0.1)
        first = TouchPosterior(beliefs, layout.sensors, skeleton, ())
        seen, refused = seen_touches(touching, first, skeleton)
        _stop_if(cancelled)
    say("what all touches tell together", 0.4)
    touches = [touch.some(FRAMES_A_TOUCH) for touch in seen]
    posterior = TouchPosterior(beliefs, layout.sensors, skeleton, touches, cancelled)
    lessons, told = touch_lessons(seen, posterior, layout.rotations)
    lessons = [*known_lessons(known, posterior), *lessons]
    if not lessons:
        raise NotTrainable(nothing_left(skeleton is not None, len(touching), refused))
    say("second pass: training on all samples", 0.5)
    model = train(
        [each.take for each in lessons],
        taught_layout(layout, told),
        subject,
        settings,
        take_hashes=take_hashes,
        parent=parent,
        cancelled=cancelled,
        report=lambda sentence, fraction: say(sentence, 0.5 + 0.5 * fraction),
    )
    model = with_live_noise(replace(model, layout=layout), lessons, posterior)
    say("trained", 1.0)
    said = [hold_sentence(len(samples.holds), hold_sd_deg(samples))] if samples.holds else []
    said += guided_sentences(seen, refused, told, posterior, skeleton)
    return GuidedCalibration(model, counted(lessons, told), tuple(refused), tuple(said))


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


def _in_order(taught: TaughtTake, layout: Layout) -> TaughtTake:
    """The layout's sensors alone, in its order."""
    take = taught.take
    columns = [take.sensors.index(name) for name in layout.sensors]
    ordered = replace(take, sensors=layout.sensors, readings=take.readings[:, columns])
    return replace(taught, take=ordered)


def _stop_if(cancelled: Callable[[], bool] | None) -> None:
    if cancelled is not None and cancelled():
        raise Cancelled("training was cancelled")
