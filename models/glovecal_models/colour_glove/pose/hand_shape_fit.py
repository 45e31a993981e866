"""The hand's own shape in its glove from 20 to 50 pictures, with the poses unknown.

Poses and shape are refined together on the labels of all pixels (as ``dense``): in each round the poses are
solved for the shape at hand, then the shape for all poses at once, with each picture's pose eliminated from
the normal equations (Schur complement). What pictures leave open is held by a prior: hands differ in their
bones by 4.5 % beside their size, in their radii by 5 %, in the axes of their joints by degrees; cloth and
flesh lie aside by millimetres. One camera cannot tell a large hand from a near one, and says so by the size's
standard deviation.

Each half of the pictures is fitted, too: the shape of one half has to explain the other half better than the
starting hand does, and the deviations that are stated cover what the halves differ by; else the shape is
refused.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from glovecal_models.colour_glove.hand_shape import TILTED, HandShape
from glovecal_models.colour_glove.hand_state import DEGREES_OF_FREEDOM, FINGER_ROTATIONS, HandState
from glovecal_models.colour_glove.pose.dense import joint_equations, refine_by_labels
from glovecal_models.colour_glove.pose.hand_tracker import HandTracker
from glovecal_models.colour_glove.pose.window_step import Belief
from glovecal_models.colour_glove.pose.window_view import PrintedHand, WindowView
from glovecal_models.colour_glove.skin import ASSUMED_LENGTH_MM, LAID, RADII_MM, HandSkin, posed
from glovecal_models.errors import BadInput
from glovecal_models.hand.dimensions import DIMENSIONS
from glovecal_models.progress import Cancel, Report, stop_if

FEWEST_PICTURES, MOST_PICTURES = 20, 50
"""Pictures that are used."""
ROUNDS = 4
BONES_SD, RADII_SD = 0.045, 0.05
"""Relative, of people's hands beside their size."""
SIZE_SD, MEASURED_SIZE_SD = 0.05, 0.02
"""Relative, of a hand that nobody measured, and of one whose length somebody did."""
MOST_DISAGREEING = 0.35
"""Share of a picture's pixels: more, and its pose is not trusted."""
_WHOLE = ("hand_length", "hand_breadth")
_BONES = tuple(name for name in DIMENSIONS if name not in _WHOLE)
PARAMETERS = (
    "size",
    *_BONES,
    *(f"{name} radius" for name in RADII_MM),
    *(f"{name} {way}" for name in RADII_MM for way in LAID),
    *(f"{name} axis {way}" for name in TILTED for way in ("first", "second")),
)
"""Logarithms of what lengths of the starting hand are multiplied by (``size`` multiplies every length); mm
that flesh and cloth lie aside; degrees that axes are tilted by."""
_LENGTHS, _ASIDE = 1 + len(_BONES) + len(RADII_MM), len(LAID) * len(RADII_MM)
LAID_SD_MM, TILT_SD_DEG = (3.0, 3.0, 1.5, 1.5), 2.0
"""Of ``LAID``, and of tilts. With twice as much freedom for axes (four times for the thumb's), its roll erred
by 9 degrees on two hands that another program draws, with these by 6."""
_WIDER = 4.0
"""By so much more than equal weights for all cells say is left open: what the model leaves unexplained is
much the same in all pictures."""
_ANGLES = len(FINGER_ROTATIONS)
_STEP = np.repeat([0.02, 0.5, 0.5], [_LENGTHS, _ASIDE, 2 * len(TILTED)])
_LONGEST = np.repeat([0.12, 5.0, 5.0], [_LENGTHS, _ASIDE, 2 * len(TILTED)])
"""Of one round's step in each parameter."""


@dataclass(frozen=True, eq=False)
class FittedShape:
    """What was found. ``values`` (P,) and ``covariance`` (P, P) in the order of ``PARAMETERS``."""

    shape: HandShape
    values: np.ndarray
    covariance: np.ndarray
    used: tuple[int, ...]
    """Pictures that counted; the others showed no glove, or a pose that explained too little of them."""
    disagreeing_before: float
    disagreeing: float
    """Mean share of the used pictures' pixels whose colour is not that drawn, 0 to 1."""


@dataclass(frozen=True, eq=False)
class _Frame:
    views: list[WindowView]
    beliefs: tuple[Belief, ...]
    state: HandState


def fitted_hand_shape(
    tracker: HandTracker,
    pictures: Sequence[Sequence[np.ndarray]],
    *,
    size_sd: float = SIZE_SD,
    rounds: int = ROUNDS,
    report: Report | None = None,
    cancelled: Cancel | None = None,
) -> FittedShape:
    """``tracker``: of the starting hand and the pictures' cameras. ``pictures``: label images (H, W) uint8,
    one of each camera, of different poses; of more than ``MOST_PICTURES`` every so manieth is used.

    Raises BadInput where fewer than ``FEWEST_PICTURES`` pictures show a hand that is understood; Cancelled.
    """
    if len(pictures) < FEWEST_PICTURES:
        raise BadInput(
            f"{len(pictures)} pictures; the shape needs at least {FEWEST_PICTURES}, of different poses"
        )
    chosen = np.unique(
        np.linspace(0, len(pictures) - 1, min(MOST_PICTURES, len(pictures))).astype(int)
    ).tolist()
    alone = HandTracker(
        tracker.hand, tracker.lookup, tracker.cameras, tracker.errors, stage="dense", follows=False
    )
    frames: dict[int, _Frame] = {}
    before = []
    for done, number in enumerate(chosen):
        stop_if(cancelled, "fitting the hand's shape")
        answer = alone.answered(pictures[number], float(number))
        if answer is not None and answer.disagreeing <= MOST_DISAGREEING:
            glimpses = [
                found
                for labels, camera in zip(pictures[number], alone.cameras, strict=True)
                if (found := alone.glimpse(labels, camera)) is not None
            ]
            views, beliefs = [each.view for each in glimpses], tuple(each.blend for each in glimpses)
            frames[number] = _Frame(views, beliefs, answer.state)
            before.append(answer.disagreeing)
        if report:
            report("tracking", 0.3 * (done + 1) / len(chosen))
    if len(frames) < FEWEST_PICTURES:
        raise BadInput(
            f"{len(frames)} of {len(chosen)} pictures show a hand whose pose is understood; the shape needs "
            f"at least {FEWEST_PICTURES}, of different poses, the whole glove in view and nothing else in "
            "its colours, on the arm or behind the hand"
        )
    lengths = [size_sd] + [BONES_SD] * len(_BONES) + [RADII_SD] * len(RADII_MM)
    prior = (
        np.array([*lengths, *LAID_SD_MM * len(RADII_MM), *[TILT_SD_DEG] * (2 * len(TILTED))], dtype=float)
        ** -2.0
    )
    numbers = list(frames)
    parts = [numbers, numbers[::2], numbers[1::2]]
    fits = []
    for place, part in enumerate(parts):

        def progress(what: str, share: float, place: int = place) -> None:
            if report:
                report(what, 0.3 + 0.7 * (place + share) / len(parts))

        those = {number: frames[number] for number in part}
        fits.append(_fitted(alone, those, prior, rounds, progress, cancelled))
    (values, covariance, after), *halves = fits
    wider = _widened(halves)
    held_out = []
    for (other, _, _), part in zip(halves, reversed(parts[1:]), strict=True):
        fitted = PrintedHand(shaped(tracker.hand.skin, other), tracker.hand.pattern)
        for number in part:
            held_out.append(
                _explained(alone, tracker.hand, frames[number]) - _explained(alone, fitted, frames[number])
            )
    gained, standard_error = float(np.mean(held_out)), float(np.std(held_out) / np.sqrt(len(held_out)))
    if gained < _GAINED_TIMES * standard_error:
        raise BadInput(
            "the shape that one half of the pictures gives explains the other half no better than the hand "
            f"it began with ({100 * abs(gained):.1f} % {'more' if gained < 0 else 'fewer'} of the pixels "
            f"disagree, ± {100 * standard_error:.1f}): the glove lies differently from the printed one, or "
            "the light hides its colours. Smooth the glove, light it from all sides and record again, or go "
            "on without a shape"
        )
    covariance = wider * covariance
    size_sd = float(np.sqrt(covariance[0, 0]))
    bones_sd = {}
    for name in _BONES:  # its share of the size's deviation in it
        both = [0, PARAMETERS.index(name)]
        bones_sd[name] = float(np.sqrt(covariance[np.ix_(both, both)].sum()))
    open_still = math.sqrt(max(0.0, float(np.mean(np.square([*bones_sd.values()]))) - size_sd**2))
    if open_still > BONES_SD:
        raise BadInput(
            f"two halves of the pictures give bones that differ by more than hands do: lengths stay open by "
            f"{100 * open_still:.1f} %. Record more poses, slowly, from the palm and from the back"
        )
    shape = replace(_shape(tracker.hand.skin, values), size_sd=size_sd, bones_sd=bones_sd)
    return FittedShape(
        shape, values, covariance, tuple(frames), float(np.mean(before)), float(np.mean(after))
    )


_GAINED_TIMES = 2.0
"""Standard errors by which the held-out pictures have to be explained better."""
_HELD_OUT_STEPS = 5

_Fit = tuple[np.ndarray, np.ndarray, list[float]]


def _fitted(
    alone: HandTracker, frames: Mapping[int, _Frame], prior: np.ndarray, rounds: int, report: Report,
    cancelled: Cancel | None,
) -> _Fit:  # fmt: skip
    """Values (P,), covariance (P, P), and the disagreeing share of each frame afterwards."""
    values, hand, moved = np.zeros(len(PARAMETERS)), alone.hand, dict(frames)
    covariance = np.diag(1.0 / prior)
    for done in range(rounds):
        stop_if(cancelled, "fitting the hand's shape")
        information, pull = np.diag(prior), -prior * values
        beside = _beside(alone.hand.skin, values)
        for frame in moved.values():
            own, gradient = _about_shape(hand, frame, beside)
            information, pull = information + own, pull + gradient
        covariance = np.linalg.inv(information)
        values = values + np.clip(covariance @ pull, -_LONGEST, _LONGEST)
        hand = PrintedHand(shaped(alone.hand.skin, values), alone.hand.pattern)
        for number, frame in moved.items():
            fit = refine_by_labels(hand, frame.views, frame.state, frame.beliefs, 5)
            moved[number] = replace(frame, state=fit.state)
        report("fitting", (done + 1) / rounds)
    return values, covariance, [alone.disagreeing(each.views, each.state, hand) for each in moved.values()]


def _widened(halves: Sequence[_Fit]) -> float:
    """By how much the variances have to grow so that they cover what the halves differ by; at least 1."""
    (first, of_first, _), (second, of_second, _) = halves
    scores = np.square(first - second) / np.diag(of_first + of_second)
    return max(1.0, float(scores.mean()))


def _explained(alone: HandTracker, hand: PrintedHand, frame: _Frame) -> float:
    """Disagreeing share of a picture, its pose refined for this hand."""
    state = refine_by_labels(hand, frame.views, frame.state, frame.beliefs, _HELD_OUT_STEPS).state
    return alone.disagreeing(frame.views, state, hand)


def shaped(skin: HandSkin, values: np.ndarray) -> HandSkin:
    """A hand like ``skin``'s, as ``values`` (P,) make it."""
    return _shape(skin, values).skin()


def _shape(skin: HandSkin, values: np.ndarray) -> HandShape:
    """As ``shaped``; what is sure of it is not told."""
    by_name = dict(zip(PARAMETERS, np.exp(values[:_LENGTHS]).tolist(), strict=False))
    grown, sizes = by_name["size"], {}
    for name, size in skin.skeleton.dimensions.sizes_mm.items():
        sizes[name] = size * grown * (1.0 if name in _WHOLE else by_name[name])
    share = grown * skin.skeleton.dimensions.hand_length_mm / ASSUMED_LENGTH_MM
    radii = {
        name: (low * share * by_name[f"{name} radius"], high * share * by_name[f"{name} radius"])
        for name, (low, high) in RADII_MM.items()
    }
    laid, tilts = (
        {name: tuple(row) for name, row in zip(names, part.reshape(len(names), -1).tolist(), strict=True)}
        for names, part in ((RADII_MM, values[_LENGTHS:][:_ASIDE]), (TILTED, values[_LENGTHS + _ASIDE :]))
    )
    return HandShape(skin.skeleton.hand, sizes, radii, laid, tilts, 0.0, {})


def _beside(skin: HandSkin, values: np.ndarray) -> list[HandSkin]:
    """For each parameter a hand with a step more of it."""
    return [shaped(skin, values + step) for step in np.diag(_STEP)]


def _about_shape(
    hand: PrintedHand, frame: _Frame, beside: Sequence[HandSkin]
) -> tuple[np.ndarray, np.ndarray]:
    """Information (P, P) and gradient (P,) of one picture about the shape, its pose eliminated."""
    placed = posed(hand.skin, frame.state)
    motion = np.empty((*placed.shape, len(PARAMETERS)))
    for index, more in enumerate(beside):
        motion[:, :, index] = (posed(more, frame.state) - placed) / _STEP[index]
    hessian, gradient = joint_equations(hand, frame.views, frame.state, motion)
    # Of the look-up only angles count: its depths take the hand for the database's size, all alike.
    for belief in frame.beliefs:
        known = np.linalg.inv(belief.covariance[:_ANGLES, :_ANGLES])
        hessian[:_ANGLES, :_ANGLES] += known
        gradient[:_ANGLES] += known @ belief.state.step_from(frame.state)[:_ANGLES]
    pose, shape = slice(None, DEGREES_OF_FREEDOM), slice(DEGREES_OF_FREEDOM, None)
    carried = np.linalg.solve(hessian[pose, pose], hessian[pose, shape]).T
    information = hessian[shape, shape] - carried @ hessian[pose, shape]
    return information / _WIDER**2, (gradient[shape] - carried @ gradient[pose]) / _WIDER**2
