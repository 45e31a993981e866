"""Label images in, the hand's pose out: look-up, inverse kinematics, refinement, and the pose before.

Each stage can be the last one, so that a user sees what it buys. From picture to picture the hand is expected
where it was, the less so the more time has passed (Wang & Popovic 2009, section 5.4). That term is dangerous:
a hand once lost stays lost, and its jitter looks excellent. So every picture is also solved alone, and that
answer is taken where it explains clearly more of the picture.

What is known of the tracker's errors from rendered hands with a truth: Q, P, and honest deviations.

A posterior covariance alone claims too much: neighbouring pixels err together, the hand is not quite the
model's, and a fit may sit in the wrong valley. So each degree of freedom's standard deviation is

    exp(a + b log(posterior) + c log(share of disagreeing pixels))

with a, b, c of largest likelihood on errors of other hands than the model's, for each stage, alone and
followed from picture to picture.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from glovecal_models.colour_glove.camera_model import Camera
from glovecal_models.colour_glove.hand_state import DEGREES_OF_FREEDOM, STAGES, HandState, PoseEstimate
from glovecal_models.colour_glove.lookup import Neighbours, PoseLookup
from glovecal_models.colour_glove.pictures.picture_check import Sighting
from glovecal_models.colour_glove.pose.centroid_ik import (
    FULL_NOISE_CELLS,
    centroid_equations,
    refine_by_centroids,
)
from glovecal_models.colour_glove.pose.dense import ITERATIONS, label_equations, refine_by_labels
from glovecal_models.colour_glove.pose.window_step import Belief, damped_step
from glovecal_models.colour_glove.pose.window_view import (
    PrintedHand,
    WindowView,
)
from glovecal_models.colour_glove.skin import posed
from glovecal_models.documents import UNREADABLE_ARCHIVE
from glovecal_models.errors import BadInput
from glovecal_models.names import did_you_mean

_LEAST_DISAGREEING = 0.02
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
    """(26, 3): a, b, c, by "stage" and "stage-followed"."""

    @classmethod
    def as_posterior(cls, blend_covariance: np.ndarray, speed: np.ndarray) -> LearnedErrors:
        """Before anything was learned: each stage's posterior deviations stand as they are."""
        plain = np.tile([0.0, 1.0, 0.0], (DEGREES_OF_FREEDOM, 1))
        names = [scale_name(stage, followed) for stage in STAGES for followed in (False, True)]
        return cls(blend_covariance, speed, dict.fromkeys(names, plain))

    def deviation(
        self, stage: str, followed: bool, posterior_sd: np.ndarray, disagreeing: float
    ) -> np.ndarray:
        """(26,) standard deviations. Raises BadInput for a stage of which nothing was learned."""
        name = scale_name(stage, followed)
        if name not in self.scales:
            meant = did_you_mean(name, self.scales, there="known are")
            raise BadInput(f"errors of {name!r} were never learned; {meant}")
        features = error_features(posterior_sd[None], np.array([disagreeing]))[0]
        return np.clip(np.exp((self.scales[name] * features).sum(axis=1)), _LOW, _HIGH)

    def save(self, file: Path) -> None:
        arrays = {"blend_covariance": self.blend_covariance, "speed": self.speed}
        arrays |= {f"scale:{name}": values for name, values in self.scales.items()}
        with file.open("wb") as stream:
            np.savez(stream, allow_pickle=False, **arrays)

    @classmethod
    def load(cls, file: Path) -> LearnedErrors:
        """Raises BadInput for a file that holds something else."""
        try:
            with file.open("rb") as stream, np.load(stream, allow_pickle=False) as held:
                arrays = {name: held[name] for name in held.files}
            scales = {n.removeprefix("scale:"): v for n, v in arrays.items() if n.startswith("scale:")}
            found = cls(arrays["blend_covariance"], arrays["speed"], scales)
        except UNREADABLE_ARCHIVE as error:
            raise BadInput(
                f"{file.name} holds no errors of the colour glove's tracker that can be read; remove it, and "
                "it is made again"
            ) from error
        shapes = [found.blend_covariance.shape, found.speed.shape, *(v.shape for v in scales.values())]
        expected = [
            (DEGREES_OF_FREEDOM,) * 2,
            (DEGREES_OF_FREEDOM,),
            *[(DEGREES_OF_FREEDOM, 3)] * len(scales),
        ]
        if shapes != expected or not all(np.isfinite(array).all() for array in arrays.values()):
            raise BadInput(f"{file.name} holds arrays of shapes {shapes}, expected {expected}, all finite")
        return found


def scale_name(stage: str, followed: bool) -> str:
    return f"{stage}-followed" if followed else stage


def error_features(posterior_sd: np.ndarray, disagreeing: np.ndarray) -> np.ndarray:
    """(N, 26, 3) of posteriors (N, 26) and shares (N,)."""
    found = np.ones((*posterior_sd.shape, 3))
    found[..., 1] = np.log(posterior_sd)
    found[..., 2] = np.log(disagreeing + _LEAST_DISAGREEING)[:, None]
    return found


def fitted_scale(errors: np.ndarray, posterior_sd: np.ndarray, disagreeing: np.ndarray) -> np.ndarray:
    """(26, 3): a, b, c of largest Gaussian likelihood, by Newton's method; b is drawn to 1 and c to 0.

    ``errors`` (N, 26). Raises BadInput for fewer frames than tell anything.
    """
    if len(errors) < 30:
        raise BadInput(f"{len(errors)} frames to learn errors from; at least 30 are needed")
    features = error_features(posterior_sd, disagreeing)
    found = np.empty((DEGREES_OF_FREEDOM, 3))
    drawn_to, pull = np.array([0.0, 1.0, 0.0]), np.diag([0.0, 20.0, 20.0])
    for column in range(DEGREES_OF_FREEDOM):
        rows, squares = features[:, column], errors[:, column] ** 2
        centre = np.log(np.sqrt(squares.mean()) + 1e-9) - (rows[:, 1]).mean()
        scale = np.array([centre, 1.0, 0.0])
        for _ in range(60):
            ratio = squares * np.exp(-2.0 * np.clip(rows @ scale, -20.0, 20.0))
            slope = rows.T @ (1.0 - ratio) + pull @ (scale - drawn_to)
            curve = (rows * (2.0 * ratio)[:, None]).T @ rows + pull + 1e-6 * np.eye(3)
            step = np.clip(np.linalg.solve(curve, slope), -0.5, 0.5)
            scale = scale - step
            if np.abs(step).max() < 1e-6:
                break
        found[column] = scale
    return found


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
    posterior_sd: np.ndarray
    """(26,)."""
    disagreeing: float
    followed: bool
    """Whether the pose before has a part in it."""
    patches: tuple[int, ...]


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
        deviation = self.errors.deviation(
            self.stage, answer.followed, answer.posterior_sd, answer.disagreeing
        )
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
            state, disagreeing = self._alone(glimpses, self.stage)
            followed = False
        else:
            state, disagreeing, followed = self._followed(glimpses, before, seconds)
        beliefs = tuple(glimpse.blend for glimpse in glimpses)
        posterior = self._posterior_sd(views, beliefs, state)
        deviation = self.errors.deviation(self.stage, followed, posterior, disagreeing)
        self._before = _Before(state, deviation**2, seconds)
        return Answer(state, posterior, disagreeing, followed, self._patches(views, state))

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
        turn = np.array(camera.rotation)
        covariance = self.errors.blend_covariance
        if not np.array_equal(turn, np.eye(3)):
            carried = np.eye(DEGREES_OF_FREEDOM)
            carried[20:23, 20:23] = carried[23:, 23:] = turn.T
            covariance = carried @ covariance @ carried.T
        belief = Belief(_in_first(blend, camera), covariance)
        return Glimpse(
            WindowView.of(seen.labels, seen.window, camera), _in_first(nearest, camera), belief, seen
        )

    def _alone(
        self, glimpses: Sequence[Glimpse], stage: str, others: int = _OTHER_STARTS
    ) -> tuple[HandState, float]:
        """State and disagreeing share; ``others``: neighbours that may be started from beside the blend."""
        views, beliefs = [glimpse.view for glimpse in glimpses], tuple(glimpse.blend for glimpse in glimpses)
        start = beliefs[0].state
        if len(beliefs) > 1:
            nothing = np.zeros((DEGREES_OF_FREEDOM,) * 2)
            start = damped_step(start, beliefs, nothing, nothing[0], 0.0)
        if stage in ("nearest", "blend"):
            state = start if stage == "blend" else glimpses[0].nearest
            return state, self.disagreeing(views, state)
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
        if stage == "dense":
            state = refine_by_labels(self.hand, views, state, beliefs, self.iterations).state
            disagreeing = self.disagreeing(views, state)
        return state, disagreeing

    def _neighbour(self, glimpse: Glimpse, camera: Camera, number: int) -> HandState:
        """One of the database's entries that look like the picture, where the hand is seen."""
        found, one = glimpse.sighting, slice(number, number + 1)
        entry = Neighbours(found.neighbours.entries[one], found.neighbours.distances[one])
        return _in_first(self.lookup.placed(entry, found.window, camera), camera)

    def _followed(
        self, glimpses: Sequence[Glimpse], before: _Before, seconds: float
    ) -> tuple[HandState, float, bool]:
        """State, disagreeing share, and whether the pose before has a part in it."""
        views = [glimpse.view for glimpse in glimpses]
        variance = before.variance + (self.errors.speed * (seconds - before.seconds)) ** 2
        beliefs = (*(glimpse.blend for glimpse in glimpses), Belief(before.state, np.diag(variance)))
        followed = refine_by_centroids(self.hand, views, before.state, beliefs, FULL_NOISE_CELLS[2:])
        if self.stage == "dense":
            followed = refine_by_labels(self.hand, views, followed, beliefs, self.iterations).state
        left = self.disagreeing(views, followed)
        alone, left_alone = self._alone(glimpses, "ik", _OTHER_STARTS if left > _UNCLEAR else 0)
        if self.stage == "dense" and left_alone < 1.5 * left:
            alone = refine_by_labels(self.hand, views, alone, beliefs[:-1], self.iterations).state
            left_alone = self.disagreeing(views, alone)
        if left_alone < _CLEARLY_FEWER * left:
            return alone, left_alone, False
        return followed, left, True

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
