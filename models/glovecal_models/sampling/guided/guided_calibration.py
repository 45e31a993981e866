"""From the takes of a guided sampling to a calibration, as Wang & Neff 2013 does it in two passes.

First pass: takes with known angles. Through that model it is judged which touches happened. Second pass:
all samples, those of the touches with angles under which all touches of the session close together
(``touch_posterior.py``). With takes of one kind only (section 8.2) the other pass falls away: without known
angles the first calibration is the sensors' range put on the joints' (section 5.2.2).

How well a session tells what is left out of it: each widget between others, and each touch, one at a time.

The only true errors that a session without a reference system has. They are those of its calibration as it is
believed (``rotation_posterior.py``, ``touch_posterior.py``); the regressor trained on it follows it closely.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.samples import require_layout
from glovecal_models.calibration.training import train
from glovecal_models.calibration.training_settings import TrainingSettings
from glovecal_models.errors import NotTrainable
from glovecal_models.hand.skeleton import Skeleton
from glovecal_models.layout import Layout
from glovecal_models.progress import Cancel, Report, stop_if
from glovecal_models.sampling.guided.labelled_takes import (
    FK,
    LabelledFrames,
    LabelledTake,
    Moved,
    hold_sd_deg,
    labelled_takes,
)
from glovecal_models.sampling.guided.rotation_posterior import Ranges, first_posteriors, reading_ranges
from glovecal_models.sampling.guided.seen_touches import (
    LabelledSamples,
    RefusedTouch,
    SampleCount,
    SeenTouch,
    closing_touches,
    counted,
    guided_sentences,
    hold_sentence,
    known_samples,
    labelled_layout,
    nothing_left,
    seen_touches,
    touch_samples,
    with_open_variance,
)
from glovecal_models.sampling.guided.touch_posterior import TouchPosterior
from glovecal_models.takes.take import Take

FEWEST = 3
"""Angles of a rotation, or touches, without which leaving one out leaves too little."""
FRAMES_A_TOUCH = 40
SAMPLES_SHARE = 0.3
"""Of the work that goes before the training."""
BASELINES = ("raw", "linear")
"""Methods that take known angles as they are, and no touches."""
HELD_OUT = "widgets left out, one at a time"


@dataclass(frozen=True)
class HeldOutErrors:
    widget_rmse_deg: dict[str, float]
    """By rotation: of frames with a widget that was left out, over its widgets but the first and the last,
    without which nothing would tell the ends of the range."""
    touch_mm: dict[str, float]
    """By touch: how far apart its tips are (median) in a calibration that knows only the others."""

    @property
    def rmse_deg(self) -> float | None:
        errors = np.array(list(self.widget_rmse_deg.values()))
        return float(np.sqrt(np.mean(errors**2))) if len(errors) else None

    def sentences(self) -> list[str]:
        said = []
        if self.rmse_deg is not None:
            worst = max(self.widget_rmse_deg, key=lambda name: self.widget_rmse_deg[name])
            said.append(
                f"Widgets left out, one at a time, are read {self.rmse_deg:.1f} degrees off (RMSE over the "
                f"inner ones of {len(self.widget_rmse_deg)} rotations; worst is {worst}, "
                f"{self.widget_rmse_deg[worst]:.1f})."
            )
        if self.touch_mm:
            each = ", ".join(f"{name} {gap:.1f}" for name, gap in self.touch_mm.items())
            said.append(f"Touches left out, one at a time, miss by (mm, median): {each}.")
        return said


def held_out_errors(
    layout: Layout,
    samples: LabelledFrames,
    ranges: Ranges,
    skeleton: Skeleton | None,
    seen: Sequence[SeenTouch],
    whole: TouchPosterior,
    cancelled: Cancel | None = None,
) -> HeldOutErrors:
    """Nothing of what has fewer than ``FEWEST`` to choose from. Raises Cancelled."""
    widgets = {}
    for rotation in samples.rotations:
        angles = np.unique(samples.of_widgets(rotation, ())[1])
        if len(angles) >= FEWEST:
            errors = [_of_widget(layout, samples, ranges, rotation, angle) for angle in angles[1:-1].tolist()]
            widgets[rotation] = float(np.sqrt(np.mean(np.concatenate(errors) ** 2)))
        stop_if(cancelled, "leaving out widgets")
    return HeldOutErrors(widgets, _of_touches(layout, skeleton, seen, whole, cancelled))


def _of_widget(
    layout: Layout, samples: LabelledFrames, ranges: Ranges, rotation: str, angle: float
) -> np.ndarray:
    """Errors (N,) of the frames with the widget of ``angle`` in a posterior from all others, degrees."""
    sensors = layout.correspondence(rotation).sensors
    readings, angles = samples.of_widgets(rotation, sensors)
    others = replace(samples, moved=tuple(_without(moved, rotation, angle) for moved in samples.moved))
    process = first_posteriors(layout, others, ranges, only=[rotation])[rotation]
    return process.mean(readings[angles == angle]) - angle


def _without(moved: Moved, rotation: str, angle: float) -> Moved:
    if rotation not in moved.take.rotations:
        return moved
    reference = moved.take.reference.copy()
    column = reference[:, moved.take.rotations.index(rotation)]
    column[column == angle] = np.nan
    return replace(moved, take=replace(moved.take, reference=reference))


def _of_touches(
    layout: Layout,
    skeleton: Skeleton | None,
    seen: Sequence[SeenTouch],
    whole: TouchPosterior,
    cancelled: Cancel | None,
) -> dict[str, float]:
    if skeleton is None or len(seen) < FEWEST:
        return {}
    found = {}
    for touch in seen:
        others = [other.some(FRAMES_A_TOUCH) for other in seen if other is not touch]
        posterior = TouchPosterior(whole.priors, layout.sensors, skeleton, others, cancelled)
        found[touch.pose] = float(np.median(posterior.apart_mm(touch.some(FRAMES_A_TOUCH), skeleton)))
    return found


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
    labelled_samples: tuple[LabelledSamples, ...]
    posterior: TouchPosterior
    """The likeliest calibration before any training."""
    without: HeldOutErrors

    def finished(self, model: CalibrationModel) -> CalibrationModel:
        """A ``model`` trained on ``takes`` by ``layout``, as it is to be kept.

        Where it has no error estimate it gets that of ``guided_calibration.py``.
        """
        model = with_open_variance(
            replace(model, layout=self.glove_layout), self.labelled_samples, self.posterior
        )
        return model if "rmse_deg" in model.error_estimate else self._with_estimate(model)

    def _with_estimate(self, model: CalibrationModel) -> CalibrationModel:
        errors, rmse_deg = self.without.widget_rmse_deg, self.without.rmse_deg
        estimate: dict[str, Any] = {"how": HELD_OUT, "folds": 0, "touch_mm": self.without.touch_mm}
        if rmse_deg is not None:
            estimate["rmse_deg"] = rmse_deg
        rotations = (replace(item, held_out_rmse_deg=errors.get(item.rotation)) for item in model.rotations)
        return replace(model, rotations=tuple(rotations), error_estimate=estimate)


@dataclass(frozen=True)
class GuidedCalibration:
    model: CalibrationModel
    samples: tuple[SampleCount, ...]
    refused: tuple[RefusedTouch, ...]
    sentences: tuple[str, ...]


def guided_samples(
    takes: Sequence[LabelledTake],
    layout: Layout,
    skeleton: Skeleton | None,
    *,
    cancelled: Cancel | None = None,
    report: Report | None = None,
) -> GuidedSamples:
    """Both passes but for the training; see ``guided_calibration``. Raises as it does."""
    say = report or (lambda sentence, fraction: None)
    for labelled in takes:
        require_layout(labelled.take, layout)
    used = [labelled.in_order(layout) for labelled in takes]
    known = [labelled for labelled in used if labelled.kind in FK]
    touching = [labelled for labelled in used if labelled.contacts]
    if not known and not touching:
        raise NotTrainable(nothing_left(skeleton is not None, 0, ()))
    say("what poses and widgets tell", 0.0)
    samples = labelled_takes(used)
    readings = np.concatenate([labelled.take.readings[labelled.take.pre_roll_frames :] for labelled in used])
    ranges = reading_ranges(layout.sensors, readings)
    priors = first_posteriors(layout, samples, ranges)
    seen: list[SeenTouch] = []
    refused: list[RefusedTouch] = []
    if touching and skeleton is not None:
        say("first pass: which touches can be seen in what poses and widgets labelled", 0.1)
        first = TouchPosterior(priors, layout.sensors, skeleton, ())
        seen, refused = seen_touches(touching, first, skeleton)
        stop_if(cancelled, "training")
    say("what all touches tell together", 0.5)
    posterior = TouchPosterior(priors, layout.sensors, skeleton, (), cancelled)
    if seen and skeleton is not None:
        posterior, seen, strange = closing_touches(priors, layout.sensors, skeleton, seen, cancelled)
        refused += strange
    inferred, told = touch_samples(seen, posterior, layout.rotations)
    labelled_samples = (*known_samples(known, posterior, told), *inferred)
    if not labelled_samples:
        raise NotTrainable(nothing_left(skeleton is not None, len(touching), refused))
    say("how well the session tells what is left out of it", 0.8)
    without = held_out_errors(layout, samples, ranges, skeleton, seen, posterior, cancelled)
    said = [hold_sentence(len(samples.holds), hold_sd_deg(samples, layout))] if samples.holds else []
    said += [*guided_sentences(seen, refused, told, posterior, skeleton), *without.sentences()]
    say("second pass: all samples have their angles", 1.0)
    return GuidedSamples(
        takes=tuple(one.take for one in labelled_samples),
        layout=labelled_layout(layout, told),
        glove_layout=layout,
        samples=counted(labelled_samples, told),
        refused=tuple(refused),
        sentences=tuple(said),
        labelled_samples=labelled_samples,
        posterior=posterior,
        without=without,
    )


def guided_calibration(
    takes: Sequence[LabelledTake],
    layout: Layout,
    subject: str,
    skeleton: Skeleton | None,
    settings: TrainingSettings | None = None,
    *,
    take_hashes: Sequence[str] = (),
    parent: str | None = None,
    cancelled: Cancel | None = None,
    report: Report | None = None,
) -> GuidedCalibration:
    """Train on the takes of one or several samplings of a subject, whose hand is ``skeleton``.

    Without a skeleton, and for the methods ``raw`` and ``linear``, touches are not used. Takes of kinds
    ``range`` and ``verification`` only show the sensors' range. Raises NotTrainable where nothing is left to
    train on, with the reason of every touch that was refused, LayoutMismatch, Cancelled.
    """
    settings = settings or TrainingSettings()
    how = {"take_hashes": take_hashes, "parent": parent, "cancelled": cancelled}
    if settings.method in BASELINES:
        return _plain(takes, layout, subject, settings, report=report, **how)
    say = report or (lambda sentence, fraction: None)

    def first(sentence: str, fraction: float) -> None:
        say(sentence, SAMPLES_SHARE * fraction)

    def then(sentence: str, fraction: float) -> None:
        say(f"second pass: {sentence}", SAMPLES_SHARE + (1 - SAMPLES_SHARE) * fraction)

    found = guided_samples(takes, layout, skeleton, cancelled=cancelled, report=first)
    model = found.finished(
        train(found.takes, found.layout, subject, replace(settings, folds=0), report=then, **how)
    )
    say("trained", 1.0)
    return GuidedCalibration(model, found.samples, found.refused, found.sentences)


def _plain(
    takes: Sequence[LabelledTake], layout: Layout, subject: str, settings: TrainingSettings, **how: Any
) -> GuidedCalibration:
    """A baseline: known angles as they are."""
    known = [labelled for labelled in takes if labelled.kind in FK and labelled.take.rotations]
    if not known:
        raise NotTrainable(f"method {settings.method} needs poses or widgets; touches are not used by it")
    model = train([labelled.take for labelled in known], layout, subject, settings, **how)
    samples = labelled_takes(known)
    counts = [
        SampleCount(
            name,
            kind,
            sum(
                len(rows)
                for labelled in known
                if labelled.kind == kind and name in labelled.take.rotations
                for rows in labelled.steps()
            ),
        )
        for name in samples.rotations
        for kind in FK
    ]
    said = f"Trained by method {settings.method}, which takes known angles as they are and no touches."
    return GuidedCalibration(model, tuple(item for item in counts if item.samples), (), (said,))
