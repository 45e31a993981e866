"""What a guided sampling teaches: takes to train on, made as Wang & Neff 2013 does it in two passes.

First pass: takes with known angles. Through these beliefs it is judged which touches happened. Second pass:
all samples, those of the touches with angles under which all touches of the session close together
(``touch_posterior.py``). With takes of one kind only (section 8.2) the other pass falls away: without known
angles the first calibration is the sensors' range put on the joints' (section 5.2.2).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from glovecal_models.calibration.samples import require_layout
from glovecal_models.calibration.training_settings import Report
from glovecal_models.errors import Cancelled, NotTrainable
from glovecal_models.guided.first_beliefs import Ranges, first_beliefs, reading_ranges
from glovecal_models.guided.left_out import LeftOut, left_out
from glovecal_models.guided.second_pass import Lesson, known_lessons, taught_layout, touch_lessons
from glovecal_models.guided.seen_touches import RefusedTouch, SeenTouch, seen_touches
from glovecal_models.guided.sentences import guided_sentences, hold_sentence, nothing_left
from glovecal_models.guided.taught_samples import TaughtSamples, hold_sd_deg, taught_samples
from glovecal_models.guided.taught_take import FK, TaughtTake
from glovecal_models.guided.touch_posterior import TouchPosterior
from glovecal_models.hand.skeleton import Skeleton
from glovecal_models.layout import Layout
from glovecal_models.takes.take import Take

FRAMES_A_TOUCH = 100
"""Of each touch that the search for the likeliest calibration looks at."""


@dataclass(frozen=True)
class GuidedLessons:
    lessons: tuple[Lesson, ...]
    layout: Layout
    """How the rotations are to be read: unlike the glove's where touches tell of a joint without a sensor."""
    told: dict[str, float]
    """By rotation: the share of what was open that touches told, 0 to 1."""
    posterior: TouchPosterior
    without: LeftOut
    refused: tuple[RefusedTouch, ...]
    sentences: tuple[str, ...]

    @property
    def takes(self) -> list[Take]:
        return [lesson.take for lesson in self.lessons]


def guided_lessons(
    takes: Sequence[TaughtTake],
    layout: Layout,
    skeleton: Skeleton | None,
    *,
    cancelled: Callable[[], bool] | None = None,
    report: Report | None = None,
) -> GuidedLessons:
    """Of the takes of one or several samplings of a subject, whose hand is ``skeleton`` (None: no touches).

    Raises NotTrainable where nothing is left, with the reason of every touch that was refused,
    LayoutMismatch, Cancelled.
    """
    say = report or (lambda sentence, fraction: None)
    for taught in takes:
        require_layout(taught.take, layout)
    used = [taught.in_order(layout) for taught in takes]
    known, touching = known_of(used), [taught for taught in used if taught.contacts]
    say("what the poses and widgets tell", 0.0)
    samples, ranges, first = _first_pass(used, layout)
    _stop_if(cancelled)
    seen: list[SeenTouch] = []
    refused: list[RefusedTouch] = []
    if skeleton is not None:
        say("first pass: which touches can be seen in what poses and widgets taught", 0.2)
        seen, refused = seen_touches(touching, first, skeleton)
        _stop_if(cancelled)
    say("what all touches tell together", 0.4)
    touches = [touch.some(FRAMES_A_TOUCH) for touch in seen]
    posterior = TouchPosterior(first.beliefs, layout.sensors, skeleton, touches, cancelled)
    lessons, told = touch_lessons(seen, posterior, layout.rotations)
    lessons = [*known_lessons(known, posterior), *lessons]
    if not lessons:
        raise NotTrainable(nothing_left(skeleton is not None, len(touching), refused))
    say("how well the session tells what is left out of it", 0.8)
    without = left_out(layout, samples, ranges, skeleton, seen, posterior, cancelled)
    said = [hold_sentence(len(samples.holds), hold_sd_deg(samples))] if samples.holds else []
    said += [*guided_sentences(seen, refused, told, posterior, skeleton), *without.sentences()]
    return GuidedLessons(
        tuple(lessons), taught_layout(layout, told), told, posterior, without, tuple(refused), tuple(said)
    )  # fmt: skip


def known_of(takes: Iterable[TaughtTake]) -> list[TaughtTake]:
    """Those whose angles were known beforehand."""
    return [taught for taught in takes if taught.kind in FK]


def _first_pass(used: Sequence[TaughtTake], layout: Layout) -> tuple[TaughtSamples, Ranges, TouchPosterior]:
    """What poses and widgets tell, and the calibration without any touch."""
    samples = taught_samples(known_of(used))
    readings = np.concatenate([taught.take.readings[taught.take.lead_in_frames :] for taught in used])
    ranges = reading_ranges(layout.sensors, readings)
    beliefs = first_beliefs(layout, samples, ranges)
    return samples, ranges, TouchPosterior(beliefs, layout.sensors, None, ())


def _stop_if(cancelled: Callable[[], bool] | None) -> None:
    if cancelled is not None and cancelled():
        raise Cancelled("training was cancelled")
