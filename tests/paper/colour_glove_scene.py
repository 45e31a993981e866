"""What the colour glove's accuracy is measured on: a glove, one or two cameras, drawn photographs of them.

The hand before the cameras is the tracker's own, or another (bones, radii and size differ by 4.5, 5 and 2 %);
in each picture are a forearm, a face and things of the room, and in every third the hand moves while it is
exposed. Colours are learned from eight other photographs of the tracker's hand.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from other_gloves import other_hand
from scipy.spatial.transform import Rotation

from glovecal_models.colour_glove.camera_model import Camera
from glovecal_models.colour_glove.database import (
    ENTRIES,
    DatabaseSettings,
    orientations,
    palm_centre,
    pose_database,
)
from glovecal_models.colour_glove.hand_state import DEGREES_OF_FREEDOM, HandState
from glovecal_models.colour_glove.lookup import PoseLookup, pca_code
from glovecal_models.colour_glove.pattern import printed_pattern
from glovecal_models.colour_glove.photograph import (
    ASIDE,
    FARTHEST_MM,
    NEAREST_MM,
    Photographer,
    Photography,
)
from glovecal_models.colour_glove.pictures.classify import ColourTable, drawn_colours
from glovecal_models.colour_glove.pose.hand_tracker import HandTracker, shipped_errors
from glovecal_models.colour_glove.pose.window_view import PrintedHand
from glovecal_models.colour_glove.pose_set import PAPER_COUNT, generated_poses
from glovecal_models.colour_glove.skin import HandSkin, hand_skin, posed
from glovecal_models.progress import Report, part

HANDS = ("the tracker's", "another")
PROOF_SEED = 2009
"""Of the frames held out; constants of the tracker were chosen on frames of other seeds."""
EXPOSURE_S = 0.01
_LENS = (-0.12, 0.05, 0.0005, -0.0004, 0.0)
_APART_DEG, _MEETING_MM = 60.0, 470.0
_QUICK_ENTRIES = 600


@dataclass(frozen=True, eq=False)
class Scene:
    folder: Path
    quick: bool
    report: Report

    @cached_property
    def hand(self) -> PrintedHand:
        return PrintedHand(hand_skin(), printed_pattern())

    @cached_property
    def colours(self) -> ColourTable:
        return drawn_colours(self.hand.skin, self.hand.pattern)

    @cached_property
    def lookup(self) -> PoseLookup:
        entries = _QUICK_ENTRIES if self.quick else ENTRIES
        database = pose_database(
            self.hand.skin, self.hand.pattern, generated_poses(PAPER_COUNT, free=0.0), self.folder,
            DatabaseSettings(entries), workers=1, report=part(self.report, 0.0, 0.2),
        )  # fmt: skip
        return PoseLookup(database, pca_code(database.transforms))

    def tracker(self, count: int, stage: str, *, follows: bool = False) -> HandTracker:
        """With ``count`` cameras."""
        errors = shipped_errors(count, "right")
        return HandTracker(self.hand, self.lookup, cameras(count), errors, stage=stage, follows=follows)

    def skin(self, whose: str, seed: int) -> HandSkin:
        return self.hand.skin if whose == HANDS[0] else other_hand(self.hand.skin, seed)

    def photographs(
        self, skin: HandSkin, views: Sequence[Camera], state: HandState, until: HandState | None, seed: int
    ) -> list[np.ndarray]:
        """By each camera, (H, W, 3) uint8."""
        look = Photography(arm=("skin", "sleeve")[seed % 2])
        found = []
        for number, camera in enumerate(views):
            drawn = Photographer(skin, self.hand.pattern, camera, look, 10_000 * (number + 1) + seed)
            found.append(drawn.photograph(state, until).picture)
        return found


def cameras(count: int) -> tuple[Camera, ...]:
    """One, or two whose axes meet at 60 degrees where the hand is."""
    first = Camera(distortion=_LENS)
    turn = Rotation.from_euler("y", -_APART_DEG, degrees=True).as_matrix()
    meeting = np.array([0.0, 0.0, _MEETING_MM])
    x, y, z = meeting - turn @ meeting
    second = Camera(
        distortion=_LENS, rotation=tuple(tuple(row) for row in turn.tolist()), translation_mm=(x, y, z)
    )
    return (first, second)[:count]


def held_out_states(skin: HandSkin, count: int, seed: int = PROOF_SEED) -> list[HandState]:
    """Configurations that the database was not made of, fingers up to 75 degrees from upright."""
    rng = np.random.default_rng([seed, 5])
    angles, turns = generated_poses(count, seed=seed, free=0.0), orientations(count, 75.0, rng)
    found = []
    for bend, turn in zip(angles, turns, strict=True):
        depth = rng.uniform(NEAREST_MM, FARTHEST_MM)
        across, down = rng.uniform(-1.0, 1.0, 2) * ASIDE * depth
        found.append(HandState(bend, turn, np.array([across, down, depth]) - turn @ palm_centre(skin)))
    return found


def exposed(state: HandState, speed: np.ndarray, rng: np.random.Generator) -> tuple[HandState, HandState]:
    """Where a hand that passes ``state`` begins and ends an exposure; ``speed`` (26,): RMS, per second."""
    half = 0.5 * EXPOSURE_S * speed * rng.standard_normal(DEGREES_OF_FREEDOM)
    return state.moved(-half), state.moved(half)


def reprojection_px(
    camera: Camera, skin: HandSkin, state: HandState, model: HandSkin, found: HandState
) -> float:
    """Root mean square distance of the skin's vertices in the picture, true and estimated."""
    apart = camera.project(posed(skin, state)[::20]) - camera.project(posed(model, found)[::20])
    return float(np.sqrt(np.nanmean((apart**2).sum(axis=1))))
