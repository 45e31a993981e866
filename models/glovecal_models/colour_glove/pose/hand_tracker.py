"""Label images in, the hand's pose out: look-up, inverse kinematics, refinement, and the pose before.

Each stage can be the last one, so that a user sees what it buys. From picture to picture the hand is expected
where it was, the less so the more time has passed (Wang & Popovic 2009, section 5.4). That term is dangerous:
a hand once lost stays lost, and its jitter looks excellent. So every picture is also solved alone, and that
answer is taken where it explains clearly more of the picture.

What is known of the tracker's errors from rendered hands with a truth: Q, P, and honest deviations.

A posterior covariance alone claims too much: neighbouring pixels err together, the hand is not quite the
model's, the cloth lies aside, and a fit may sit in the wrong valley. So what is stated of each degree of
freedom follows from what goes along with large errors (``EVIDENCE``), by

    log(standard deviation) = a + b . evidence

so that 95 % of the errors of other hands than the model's, in gloves that lie aside and in many lights, are
within 1.96 of it (quantile regression, R. Koenker and G. Bassett 1978, "Regression Quantiles", Econometrica
46(1), 33-50), for each stage, alone and followed from picture to picture.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from glovecal_models.colour_glove.camera_model import Camera
from glovecal_models.colour_glove.database import ENTRIES, DatabaseSettings, pose_database
from glovecal_models.colour_glove.hand_shape import HandShape
from glovecal_models.colour_glove.hand_state import (
    DEGREES_OF_FREEDOM,
    FINGER_ROTATIONS,
    STAGES,
    HandState,
    PoseEstimate,
)
from glovecal_models.colour_glove.lookup import PoseLookup, pca_code
from glovecal_models.colour_glove.pattern import printed_pattern
from glovecal_models.colour_glove.pictures.picture_check import Sighting
from glovecal_models.colour_glove.pose.centroid_ik import (
    FULL_NOISE_CELLS,
    centroid_equations,
    refine_by_centroids,
)
from glovecal_models.colour_glove.pose.dense import ITERATIONS, label_equations, refine_by_labels
from glovecal_models.colour_glove.pose.window_step import Belief, damped_step
from glovecal_models.colour_glove.pose.window_view import (
    PARTS,
    PrintedHand,
    WindowView,
)
from glovecal_models.colour_glove.pose_set import PAPER_COUNT, generated_poses
from glovecal_models.colour_glove.skin import hand_skin, posed
from glovecal_models.documents import UNREADABLE_ARCHIVE
from glovecal_models.errors import BadInput
from glovecal_models.hand.rotations import Handedness
from glovecal_models.names import did_you_mean
from glovecal_models.progress import Cancel, Report

EVIDENCE = ("one", "posterior", "disagreeing", "part disagreeing", "moved", "from look-up")
"""Logarithms, but for the first: of the posterior deviation; of the share of disagreeing points, of the whole
hand and of the finger drawn; of how far the last stage moved the answer of the one before it, and of how far
the answer is from the look-up's; degrees and mm."""
_LEAST_DISAGREEING, _LEAST_OF_PART, _LEAST_MOVED, _LEAST_FROM_LOOKUP = 0.02, 0.05, 1.0, 2.0
COVERED, _WITHIN = 0.95, 1.96
"""Share of errors that lie within so many standard deviations as stated."""
_SMOOTH, _PULL = 0.1, 10.0
"""Of the quantile's loss, in logarithms; and of what evidence counts, towards the posterior alone."""
_OF_SPREAD = {"IM": "I", "MR": "R", "RP": "P"}
_PART_OF = [PARTS.index(_OF_SPREAD.get(name[:2], name[0])) for name in FINGER_ROTATIONS] + [0] * 6
_RANGE = {"angles": (0.3, 60.0), "turn": (0.2, 90.0), "position": (0.2, 300.0)}
"""Of a stated deviation, degrees, degrees, mm: what learning saw ends there."""
_LOW, _HIGH = (
    np.array([_RANGE["angles"][end]] * 20 + [_RANGE["turn"][end]] * 3 + [_RANGE["position"][end]] * 3)
    for end in (0, 1)
)
LONGEST_UNSEEN_S = 0.5
"""Without a picture of the glove: after more, nothing is expected of the next."""
_CLEARLY_FEWER = 0.9
"""Of the followed answer's disagreeing points: then the picture alone knows better."""
_UNCLEAR, _OTHER_STARTS = 0.25, 3
"""Of disagreeing points: above, inverse kinematics also starts from single neighbours, this many at most."""
ACCEPTED_SD_DEG = 5.0
"""A joint that is known as well as this may serve as a reference."""


@dataclass(frozen=True, eq=False)
class LearnedErrors:
    blend_covariance: np.ndarray
    """Q, (26, 26): of true states about blended neighbours, in steps of ``HandState.moved``."""
    speed: np.ndarray
    """P, (26,): how fast a hand departs from where it was, degrees and mm a second, root mean square."""
    scales: Mapping[str, np.ndarray]
    """(26, 6): how each of ``EVIDENCE`` counts, by "stage" and "stage-followed"."""

    @classmethod
    def as_posterior(cls, blend_covariance: np.ndarray, speed: np.ndarray) -> LearnedErrors:
        """Before anything was learned: each stage's posterior deviations stand as they are."""
        plain = np.tile(_POSTERIOR_ALONE, (DEGREES_OF_FREEDOM, 1))
        names = [scale_name(stage, followed) for stage in STAGES for followed in (False, True)]
        return cls(blend_covariance, speed, dict.fromkeys(names, plain))

    def deviation(self, stage: str, followed: bool, evidence: np.ndarray) -> np.ndarray:
        """(26,) standard deviations, of ``evidence`` (26, 6). Raises BadInput for a stage never learned."""
        name = scale_name(stage, followed)
        if name not in self.scales:
            meant = did_you_mean(name, self.scales, there="known are")
            raise BadInput(f"errors of {name!r} were never learned; {meant}")
        return np.clip(np.exp((self.scales[name] * evidence).sum(axis=1)), _LOW, _HIGH)

    def arrays(self) -> dict[str, np.ndarray]:
        """As ``load`` reads them."""
        own = {"blend_covariance": self.blend_covariance, "speed": self.speed}
        return own | {f"scale:{name}": values for name, values in self.scales.items()}

    @classmethod
    def load(cls, file: Path, beginning: str = "") -> LearnedErrors:
        """From an archive (``.npz``), of the arrays whose names have this beginning. Raises BadInput for a
        file that holds something else."""
        try:
            with file.open("rb") as stream, np.load(stream, allow_pickle=False) as held:
                names = {n.removeprefix(beginning): n for n in held.files if n.startswith(beginning)}
                arrays = {short: held[name].astype(float) for short, name in names.items()}
            scales = {n.removeprefix("scale:"): v for n, v in arrays.items() if n.startswith("scale:")}
            found = cls(arrays["blend_covariance"], arrays["speed"], scales)
        except UNREADABLE_ARCHIVE as error:
            raise BadInput(
                f"{file.name} holds no errors of the colour glove's tracker that can be read"
            ) from error
        shapes = [found.blend_covariance.shape, found.speed.shape, *(v.shape for v in scales.values())]
        expected = [
            (DEGREES_OF_FREEDOM,) * 2,
            (DEGREES_OF_FREEDOM,),
            *[(DEGREES_OF_FREEDOM, len(EVIDENCE))] * len(scales),
        ]
        if shapes != expected or not all(np.isfinite(array).all() for array in arrays.values()):
            raise BadInput(f"{file.name} holds arrays of shapes {shapes}, expected {expected}, all finite")
        return found


def scale_name(stage: str, followed: bool) -> str:
    return f"{stage}-followed" if followed else stage


_POSTERIOR_ALONE = np.array([0.0, 1.0, 0.0, 0.0, 0.0, 0.0])


def fitted_scale(errors: np.ndarray, evidence: np.ndarray) -> np.ndarray:
    """(D, 6): how evidence (N, D, 6) counts, so that ``COVERED`` of ``errors`` (N, D) lie within as many
    deviations as that share of a Gaussian's does. Raises BadInput for fewer frames than tell anything.

    The pinball loss of the errors' logarithms, smoothed (softplus), by quasi-Newton steps; it is convex.
    """
    if len(errors) < 30:
        raise BadInput(f"{len(errors)} frames to learn errors from; at least 30 are needed")
    from scipy.optimize import minimize

    def loss(scale: np.ndarray, rows: np.ndarray, wanted: np.ndarray) -> tuple[float, np.ndarray]:
        above = wanted - rows @ scale
        less = np.logaddexp(0.0, -above / _SMOOTH)
        off = scale - _POSTERIOR_ALONE
        off[0] = 0.0
        slope = COVERED - 1.0 / (1.0 + np.exp(np.clip(above / _SMOOTH, -60.0, 60.0)))
        scales = float(COVERED * above.sum() + _SMOOTH * less.sum() + 0.5 * _PULL * off @ off)
        return scales, -rows.T @ slope + _PULL * off

    scales = np.empty((errors.shape[1], len(EVIDENCE)))
    for column in range(errors.shape[1]):
        wanted = np.log(np.abs(errors[:, column]) / _WITHIN + 1e-3)
        rows = evidence[:, column]
        start = _POSTERIOR_ALONE + np.eye(len(EVIDENCE))[0] * np.quantile(wanted - rows[:, 1], COVERED)
        scales[column] = minimize(loss, start, (rows, wanted), "L-BFGS-B", jac=True).x
    return scales


@dataclass(frozen=True, eq=False)
class Glimpse:
    """What one camera gives before anything is refined."""

    view: WindowView
    nearest: HandState
    blend: Belief
    """In the frame of the first camera."""
    sighting: Sighting


@dataclass(frozen=True, eq=False)
class Answer:
    """The state of least cost, and what errors are told from."""

    state: HandState
    evidence: np.ndarray
    """(26, 6), of ``EVIDENCE``."""
    disagreeing: float
    followed: bool
    """Whether the pose before has a part in it."""
    patches: tuple[int, ...]


@dataclass(frozen=True, eq=False)
class _Solved:
    state: HandState
    start: HandState
    """Of the last stage: what the one before it answered."""
    disagreeing: float
    followed: bool = False


@dataclass(frozen=True, eq=False)
class _Before:
    state: HandState
    variance: np.ndarray
    seconds: float


class HandTracker:
    """One hand before one or more cameras. Raises BadInput for another stage and for no camera."""

    def __init__(
        self,
        hand: PrintedHand,
        lookup: PoseLookup,
        cameras: Sequence[Camera],
        errors: LearnedErrors,
        *,
        stage: str = "dense",
        follows: bool = True,
        iterations: int = ITERATIONS,
    ) -> None:
        if stage not in STAGES:
            raise BadInput(f"stage {stage!r} is none of {', '.join(STAGES)}")
        if not cameras:
            raise BadInput("a hand is tracked by at least one camera; none was given")
        self.hand, self.lookup, self.cameras, self.errors = hand, lookup, tuple(cameras), errors
        self.stage, self.follows, self.iterations = stage, follows, iterations
        self._before: _Before | None = None
        self._last_drawn: tuple[WindowView, HandState, PrintedHand, np.ndarray] | None = None

    def forget(self) -> None:
        """The next picture stands alone."""
        self._before = None

    def track(self, label_images: Sequence[np.ndarray], seconds: float) -> PoseEstimate | None:
        """The pose at ``seconds``, from one label image (H, W) uint8 of each camera; None: no glove in any.

        Raises BadInput for another number of images, and images that are none.
        """
        answer = self.answered(label_images, seconds)
        if answer is None:
            return None
        deviation = self.errors.deviation(self.stage, answer.followed, answer.evidence)
        accepted = deviation[:20] <= ACCEPTED_SD_DEG
        return PoseEstimate(answer.state, deviation, accepted, answer.patches, answer.disagreeing, self.stage)

    def answered(self, label_images: Sequence[np.ndarray], seconds: float) -> Answer | None:
        """As ``track``, before what the posterior says is compared with real errors."""
        if len(label_images) != len(self.cameras):
            raise BadInput(f"{len(label_images)} pictures of {len(self.cameras)} cameras")
        glimpses = [
            found
            for labels, camera in zip(label_images, self.cameras, strict=True)
            if (found := self.glimpse(labels, camera)) is not None
        ]
        before = self._before
        if before is not None and not 0.0 < seconds - before.seconds <= LONGEST_UNSEEN_S:
            before = self._before = None
        if not glimpses:
            return None
        views = [glimpse.view for glimpse in glimpses]
        if self.stage in ("nearest", "blend") or before is None or not self.follows:
            solved = self._alone(glimpses, self.stage)
        else:
            solved = self._followed(glimpses, before, seconds)
        beliefs = tuple(glimpse.blend for glimpse in glimpses)
        evidence = self._evidence(views, beliefs, solved)
        deviation = self.errors.deviation(self.stage, solved.followed, evidence)
        state = solved.state
        self._before = _Before(state, deviation**2, seconds)
        return Answer(state, evidence, solved.disagreeing, solved.followed, self._patches(views, state))

    def glimpse(self, labels: np.ndarray, camera: Camera) -> Glimpse | None:
        seen = Sighting.of(labels, self.lookup)
        if seen is None:
            return None
        neighbours = seen.neighbours
        blend = self.lookup.placed(neighbours, seen.window, camera)
        first = neighbours.entries[0]
        # The nearest entry alone keeps the blend's place: the paper's look-up gives none.
        nearest = HandState(
            self.lookup.database.angles_deg[first].astype(float), blend.rotation, blend.position_mm
        )
        turn = neighbours.turn @ np.array(camera.rotation)
        covariance = self.errors.blend_covariance
        if not np.array_equal(turn, np.eye(3)):
            carried = np.eye(DEGREES_OF_FREEDOM)
            carried[20:23, 20:23] = carried[23:, 23:] = turn.T
            covariance = carried @ covariance @ carried.T
        belief = Belief(_in_first(blend, camera), covariance)
        return Glimpse(
            WindowView.of(seen.labels, seen.window, camera), _in_first(nearest, camera), belief, seen
        )

    def _alone(self, glimpses: Sequence[Glimpse], stage: str, others: int = _OTHER_STARTS) -> _Solved:
        """``others``: neighbours that may be started from beside the blend."""
        views, beliefs = [glimpse.view for glimpse in glimpses], tuple(glimpse.blend for glimpse in glimpses)
        start = beliefs[0].state
        if len(beliefs) > 1:
            nothing = np.zeros((DEGREES_OF_FREEDOM,) * 2)
            start = damped_step(start, beliefs, nothing, nothing[0], 0.0)
        if stage in ("nearest", "blend"):
            state = start if stage == "blend" else glimpses[0].nearest
            return _Solved(state, state, self.disagreeing(views, state))
        state = refine_by_centroids(self.hand, views, start, beliefs)
        disagreeing = self.disagreeing(views, state)
        for number in range(others):
            if disagreeing <= _UNCLEAR:
                break
            start = self._neighbour(glimpses[0], views[0].camera, number)
            other = refine_by_centroids(self.hand, views, start, beliefs)
            left = self.disagreeing(views, other)
            if left < disagreeing:
                state, disagreeing = other, left
        solved = _Solved(state, start, disagreeing)
        return self._refined(views, solved, beliefs) if stage == "dense" else solved

    def _refined(self, views: Sequence[WindowView], solved: _Solved, beliefs: tuple[Belief, ...]) -> _Solved:
        """On all pixels."""
        state = refine_by_labels(self.hand, views, solved.state, beliefs, self.iterations).state
        return _Solved(state, solved.state, self.disagreeing(views, state), solved.followed)

    def _neighbour(self, glimpse: Glimpse, camera: Camera, number: int) -> HandState:
        """One of the database's entries that look like the picture, where the hand is seen."""
        found, one = glimpse.sighting, slice(number, number + 1)
        entry = replace(
            found.neighbours, entries=found.neighbours.entries[one], distances=found.neighbours.distances[one]
        )
        return _in_first(self.lookup.placed(entry, found.window, camera), camera)

    def _followed(self, glimpses: Sequence[Glimpse], before: _Before, seconds: float) -> _Solved:
        """With or without the pose before having a part in it."""
        views = [glimpse.view for glimpse in glimpses]
        variance = before.variance + (self.errors.speed * (seconds - before.seconds)) ** 2
        beliefs = (*(glimpse.blend for glimpse in glimpses), Belief(before.state, np.diag(variance)))
        state = refine_by_centroids(self.hand, views, before.state, beliefs, FULL_NOISE_CELLS[2:])
        followed = _Solved(state, before.state, self.disagreeing(views, state), True)
        if self.stage == "dense":
            followed = self._refined(views, followed, beliefs)
        left = followed.disagreeing
        alone = self._alone(glimpses, "ik", _OTHER_STARTS if left > _UNCLEAR else 0)
        if self.stage == "dense" and alone.disagreeing < 1.5 * left:
            alone = self._refined(views, alone, beliefs[:-1])
        return alone if alone.disagreeing < _CLEARLY_FEWER * left else followed

    def _evidence(
        self, views: Sequence[WindowView], beliefs: tuple[Belief, ...], solved: _Solved
    ) -> np.ndarray:
        state = solved.state
        counts = [view.disagreeing_parts(self.hand, self._shown(view, state, self.hand)) for view in views]
        different, drawn = np.sum(counts, axis=0)[_PART_OF].T
        moved = np.abs(state.step_from(solved.start))
        evidence = np.ones((DEGREES_OF_FREEDOM, len(EVIDENCE)))
        evidence[:, 1] = np.log(self._posterior_sd(views, beliefs, state))
        evidence[:, 2] = np.log(solved.disagreeing + _LEAST_DISAGREEING)
        # A finger that is not in the picture at all is as wrong as may be.
        evidence[:, 3] = np.log((different + 1.0) / (drawn + 1.0) + _LEAST_OF_PART)
        evidence[:, 4] = np.log(moved + _LEAST_MOVED)
        evidence[:, 5] = np.log(np.abs(state.step_from(beliefs[0].state)) + _LEAST_FROM_LOOKUP)
        return evidence

    def _posterior_sd(
        self, views: Sequence[WindowView], beliefs: tuple[Belief, ...], state: HandState
    ) -> np.ndarray:
        """(26,): what the pictures and the look-up leave open, before it is compared with real errors."""
        information = np.sum([belief.information for belief in beliefs], axis=0)
        if self.stage == "ik":
            information = information + centroid_equations(self.hand, views, state, FULL_NOISE_CELLS[-1])[0]
        elif self.stage == "dense":
            information = information + label_equations(self.hand, views, state)
        return np.sqrt(np.diag(np.linalg.inv(information)))

    def disagreeing(
        self, views: Sequence[WindowView], state: HandState, hand: PrintedHand | None = None
    ) -> float:
        """Share of the points, seen or drawn, whose colours differ, 0 to 1; ``hand``: in place of the own."""
        hand = self.hand if hand is None else hand
        counts = [view.disagreeing(hand, self._shown(view, state, hand)) for view in views]
        different, either = np.sum(counts, axis=0)
        return float(different / max(either, 1))

    def _shown(self, view: WindowView, state: HandState, hand: PrintedHand) -> np.ndarray:
        """As ``WindowView.shown``; what was drawn last is not drawn again."""
        last = self._last_drawn
        if last is None or last[0] is not view or last[1] is not state or last[2] is not hand:
            self._last_drawn = last = view, state, hand, view.shown(hand, posed(hand.skin, state))
        return last[3]

    def _patches(self, views: Sequence[WindowView], state: HandState) -> tuple[int, ...]:
        found: set[int] = set()
        for view in views:
            found |= set(np.unique(self.hand.patch_of[self._shown(view, state, self.hand)]).tolist())
        return tuple(sorted(found - {0}))


def _in_first(state: HandState, camera: Camera) -> HandState:
    """A state in a camera's own frame, in the frame of the first."""
    turn, shift = np.array(camera.rotation), np.array(camera.translation_mm)
    return HandState(state.angles_deg, turn.T @ state.rotation, turn.T @ (state.position_mm - shift))


SHIPPED = Path(__file__).with_name("errors.npz")
_ELSEWHERE = {1: 1.45, 2: 1.27}
"""By how much hands that another program drew (tests/simulated/lit_glove.py, seeds 500 to 507) erred more
than those that errors are learned on: RMS of accepted errors over their deviations, by cameras."""
_ELSEWHERE_FITTED = {
    1: {"TMC": 1.0, "ABD": 1.05, "VIR": 1.0, "MCP": 1.75, "PIP": 1.4, "DIP": 1.0, "IP": 2.5},
    2: {"TMC": 0.9, "ABD": 0.9, "VIR": 1.0, "MCP": 1.15, "PIP": 1.05, "DIP": 0.9, "IP": 2.0},
}
"""The same where the hand's shape was fitted, by the kind of joint: what 95 % of errors ask for. The thumb's
last joint is far worse on hands that are not the model's, others a little or not at all. One camera was
too sure of bends: of what it accepted of 16 further hands (9400 to 9407, 9500 to 9507) 81 % of knuckles and
88 % of middle joints were within their interval."""
_MIRRORED = np.array([1.0] * 20 + [1.0, -1.0, -1.0] + [-1.0, 1.0, 1.0])
"""Of a step, seen in a mirror beside the hand: turns about y and z, and the place along x, change signs."""


def shipped_errors(cameras: int, hand: Handedness, *, fitted: bool = False) -> LearnedErrors:
    """Learned with one camera, or with two, which stand for more. ``fitted``: of hands whose shape was
    fitted."""
    known = min(cameras, 2)
    errors = LearnedErrors.load(SHIPPED, shipped_name(known, fitted))
    times = np.full((DEGREES_OF_FREEDOM, 1), _ELSEWHERE[known])
    if fitted:
        by_kind = _ELSEWHERE_FITTED[known]
        times[: len(FINGER_ROTATIONS), 0] = [by_kind[name.rpartition("_")[2]] for name in FINGER_ROTATIONS]
    larger = np.log(times) * np.eye(len(EVIDENCE))[0]
    errors = replace(errors, scales={name: scale + larger for name, scale in errors.scales.items()})
    if hand == "right":
        return errors
    return replace(errors, blend_covariance=errors.blend_covariance * np.outer(_MIRRORED, _MIRRORED))


def shipped_name(cameras: int, fitted: bool = False) -> str:
    """What arrays of the file begin with."""
    return f"{cameras} camera{'s'[: cameras - 1]}{', fitted' if fitted else ''}: "


def with_shape(tracker: HandTracker, shape: HandShape) -> HandTracker:
    """One that tracks the same hand in its fitted shape. The database stays that of the hand before: looking
    up only begins."""
    hand = PrintedHand(shape.skin(), tracker.hand.pattern)
    errors = shipped_errors(len(tracker.cameras), shape.hand, fitted=True)
    return HandTracker(hand, tracker.lookup, tracker.cameras, errors, stage=tracker.stage)


def prepared_tracker(
    folder: Path,
    cameras: Sequence[Camera] = (Camera(),),
    *,
    hand: PrintedHand | None = None,
    entries: int = ENTRIES,
    report: Report | None = None,
    cancelled: Cancel | None = None,
) -> HandTracker:
    """``hand``: the hand to be seen, in its glove; without one the assumed right hand in the glove that
    ``glovecal camera sheets`` prints.

    The database takes about half a minute on two cores; afterwards it is read. Raises BadInput, Cancelled.
    """
    hand = PrintedHand(hand_skin(), printed_pattern()) if hand is None else hand
    database = pose_database(
        hand.skin, hand.pattern, generated_poses(PAPER_COUNT), folder, DatabaseSettings(entries=entries),
        report=report, cancelled=cancelled,
    )  # fmt: skip
    lookup = PoseLookup(database, pca_code(database.transforms))
    errors = shipped_errors(len(cameras), hand.skin.skeleton.hand)
    return HandTracker(hand, lookup, cameras, errors)
