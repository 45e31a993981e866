"""How often faults of pictures are found, and right pictures blamed: drawn photographs, each in another room.

The limits were set on seeds below 1000; here others are counted.
"""

import time
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from lamplight import LIGHTS, ROOMS, Scene, lit_picture, taken
from other_gloves import other_hand

from glovecal_models.colour_glove.camera_model import Camera
from glovecal_models.colour_glove.database import palm_centre, pose_database
from glovecal_models.colour_glove.hand_state import HandState
from glovecal_models.colour_glove.lookup import PoseLookup, pca_code
from glovecal_models.colour_glove.pattern import Pattern, glove_pattern
from glovecal_models.colour_glove.photograph import (
    Photograph,
    Photographer,
    Photography,
    hand_motion,
    labelled_photographs,
)
from glovecal_models.colour_glove.pictures.classify import ColourTable
from glovecal_models.colour_glove.pictures.picture_check import PictureCheck
from glovecal_models.colour_glove.pose_set import PAPER_COUNT, generated_poses
from glovecal_models.colour_glove.skin import hand_skin
from glovecal_models.hand.skeleton import hand_skeleton

SKIN = hand_skin()
LEFT = hand_skin(hand_skeleton(hand="left"))
PATTERN = glove_pattern(SKIN)
CAMERA = Camera()
BEHIND = HandState(np.zeros(20), np.eye(3), np.array([0.0, 0.0, -500.0]))
COUNT, SEED = 100, 9000
OF_ONE_GLOVE = {"two hands", "mirrored", "another glove"}
"""Said of a picture of one hand in this glove, these are false whatever its light is."""
MOST_FALSE = 0.01
RIGHT_LABELS = 0.85
"""Share of the glove, and of what is labelled, that is right: such a picture can be tracked."""


class Studio:
    """Photographs of one kind after another, each in another room."""

    def __init__(self) -> None:
        self.states = hand_motion(SKIN, 2.0 * COUNT, 0.5, seed=SEED)
        self.kinds: dict[str, Callable[[int, np.random.Generator], Photograph]] = {
            "good": lambda i, rng: self.one(i, rng),
            "other bones and radii": lambda i, rng: self.one(i, rng, skin=other_hand(SKIN, SEED + i)),
            "motion blur": self.moving,
            "shadows and gloss": self.lit,
            "no hand": lambda i, rng: self.photograph(BEHIND, rng),
            "two hands apart": lambda i, rng: self.two(i, rng, 250.0),
            "two hands close": lambda i, rng: self.two(i, rng, 140.0),
            "two hands overlapping": lambda i, rng: self.two(i, rng, 90.0),
            "another pattern": lambda i, rng: self.one(i, rng, pattern=OTHERS[i % len(OTHERS)]),
            "the other hand's glove": lambda i, rng: self.one(i, rng, skin=LEFT),
            "mirrored": self.mirrored,
            "glove of one colour": lambda i, rng: self.one(i, rng, pattern=plain(1 + i % 10)),
            "other inks": self.other_inks,
            "cut off": lambda i, rng: self.photograph(at(self.states[i], (-1) ** i * 270.0), rng),
            "exposure 0.2": lambda i, rng: self.one(i, rng, exposure=0.2),
            "exposure 0.3": lambda i, rng: self.one(i, rng, exposure=0.3),
            "exposure 2": lambda i, rng: self.one(i, rng, exposure=2.0),
            "exposure 2.5": lambda i, rng: self.one(i, rng, exposure=2.5),
            "exposure 4": lambda i, rng: self.one(i, rng, exposure=4.0),
        }

    def photograph(self, state, rng, skin=SKIN, pattern=PATTERN, until=None, **look) -> Photograph:
        look = {"exposure": rng.uniform(0.75, 1.15), "arm": str(rng.choice(["skin", "sleeve"]))} | look
        room = int(rng.integers(2**31))
        return Photographer(skin, pattern, CAMERA, Photography(**look), room).photograph(state, until)

    def one(self, index, rng, **other) -> Photograph:
        return self.photograph(self.states[index], rng, **other)

    def moving(self, index, rng) -> Photograph:
        """Exposed for a whole thirtieth of a second while the hand moves."""
        first, then = hand_motion(SKIN, 1.0, 30.0, seed=SEED + index)[10:12]
        return self.photograph(first, rng, until=then)

    def mirrored(self, index, rng) -> Photograph:
        found = self.one(index, rng)
        picture, labels = (np.ascontiguousarray(each[:, ::-1]) for each in (found.picture, found.labels))
        return Photograph(picture, labels)

    def lit(self, index, rng) -> Photograph:
        """Other hands as rooms light them, down to fingers that point aside."""
        scene = Scene(
            SEED + index, LIGHTS[index % len(LIGHTS)], ROOMS[index % len(ROOMS)],
            gloss=rng.choice([0.0, 0.1, 0.25]), exposure=rng.uniform(0.75, 1.15),
            jpeg=None if index % 3 else 85,
        )  # fmt: skip
        hand = other_hand(SKIN, SEED + index)
        light, labels = lit_picture(scene, hand, PATTERN, CAMERA, [self.states[index]])
        return Photograph(taken(scene, light, CAMERA.width), labels)

    def two(self, index, rng, apart_mm) -> Photograph:
        """The left hand, as far away as the right one is or a little nearer, drawn over it."""
        look = Photography(arm="sleeve" if index % 2 else "skin")
        room, depth = int(rng.integers(2**31)), rng.uniform(420.0, 620.0)
        down, right = rng.normal(0.0, 20.0, 2), self.states[index]
        left = self.states[int(rng.integers(COUNT))]
        behind = Photographer(SKIN, PATTERN, CAMERA, look, room)
        before = Photographer(LEFT, PATTERN, CAMERA, look, room)
        first = behind.photograph(at(right, -apart_mm / 2, down[0], depth))
        second = before.photograph(at(left, apart_mm / 2, down[1], 0.97 * depth))
        drawn = (second.picture != before.photograph(BEHIND).picture).any(axis=2)
        picture = np.where(drawn[..., None], second.picture, first.picture)
        return Photograph(picture, np.where(drawn, second.labels, first.labels))

    def other_inks(self, index, rng) -> Photograph:
        """The hues of the glove turned by 50 to 310 degrees."""
        found = self.one(index, rng)
        hsv = cv2.cvtColor(found.picture, cv2.COLOR_BGR2HSV).astype(int)
        hsv[..., 0] = (hsv[..., 0] + rng.integers(25, 155)) % 180
        turned = cv2.cvtColor(hsv.astype(np.uint8), cv2.COLOR_HSV2BGR)
        glove = cv2.dilate((found.labels > 0).astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
        return Photograph(np.where(glove[..., None], turned, found.picture), found.labels)


def at(state: HandState, across: float, down: float = 0.0, depth: float = 450.0) -> HandState:
    """The same hand with its palm's centre there, mm."""
    there = np.array([across, down, depth]) - state.rotation @ palm_centre(SKIN)
    return HandState(state.angles_deg, state.rotation, there)


def plain(colour: int) -> Pattern:
    return replace(PATTERN, colour_of_patch=np.full_like(PATTERN.colour_of_patch, colour))


OTHERS = [
    replace(PATTERN, colour_of_patch=np.random.default_rng(seed).permutation(PATTERN.colour_of_patch))
    for seed in range(9)
]
EXPECTED = {
    "no hand": ({"no hand"}, 0.95),
    "two hands apart": ({"two hands"}, 0.95),
    "two hands close": ({"two hands"}, 0.9),
    "two hands overlapping": ({"two hands"}, 0.7),
    "another pattern": ({"another glove"}, 0.85),
    "the other hand's glove": ({"mirrored"}, 0.85),
    "mirrored": ({"mirrored"}, 0.85),
    "glove of one colour": ({"no hand", "another glove"}, 0.9),
    "other inks": ({"no hand", "another glove", "two hands"}, 0.9),
    "cut off": ({"cut off"}, 0.9),
    "exposure 0.2": ({"under-exposed"}, 0.95),
    "exposure 0.3": ({"under-exposed"}, 0.9),
    "exposure 2": ({"over-exposed"}, 0.5),
    "exposure 2.5": ({"over-exposed"}, 0.8),
    "exposure 4": ({"over-exposed", "no hand"}, 0.95),
}


@pytest.mark.slow
@pytest.mark.timeout(1800)
def test_how_often_faults_are_found_and_right_pictures_blamed(tmp_path: Path, capsys):
    examples = labelled_photographs(SKIN, PATTERN, CAMERA)
    table = ColourTable.trained([e.picture for e in examples], [e.labels for e in examples])
    database = pose_database(SKIN, PATTERN, generated_poses(PAPER_COUNT), tmp_path, workers=2)
    check, studio = PictureCheck(PoseLookup(database, pca_code(database.transforms))), Studio()
    times_ms = []
    lines, rates, blamed = [], {}, {}
    whole = false = 0
    for number, (kind, photographed) in enumerate(studio.kinds.items()):
        counts, wrong, judged = Counter(), 0, 0
        for index in range(COUNT):
            photograph = photographed(index, np.random.default_rng([SEED, number, index]))
            labels = table.labels(photograph.picture)
            began = time.perf_counter()
            kinds = [finding.kind for finding in check.findings(photograph.picture, labels)]
            times_ms.append(1e3 * (time.perf_counter() - began))
            counts.update(kinds or ["nothing"])
            rates[kind] = rates.get(kind, 0) + bool(set(kinds) & EXPECTED.get(kind, (set(), 0))[0]) / COUNT
            if kind not in EXPECTED and not on_the_rim(photograph.labels):
                whole, false = whole + 1, false + bool(set(kinds) & OF_ONE_GLOVE)
            if kind not in EXPECTED and is_right(photograph.labels, labels):
                judged += 1
                wrong += bool(kinds)
        if kind not in EXPECTED:
            blamed[kind] = wrong / judged
            lines.append(f"{kind}: {wrong} of {judged} that can be tracked blamed; {dict(counts)}")
        else:
            lines.append(f"{kind}: found {rates[kind]:.0%}; {dict(counts)}")
    with capsys.disabled():
        print(f"\n{COUNT} drawn photographs of each kind, limit {check.distance_limit_px2:.1f} px^2")
        print("\n".join(lines))
        print(f"a check takes {np.median(times_ms):.1f} ms (median)")
        print(f"one glove, whole in view: {false} of {whole} taken for two hands, mirrored or another glove")
    assert false <= MOST_FALSE * whole
    for kind, (_, least) in EXPECTED.items():
        assert rates[kind] >= least, kind
    for kind, share in blamed.items():
        assert share <= 0.05, kind


def on_the_rim(true: np.ndarray) -> bool:
    return bool(true[0].any() or true[-1].any() or true[:, 0].any() or true[:, -1].any())


def is_right(true: np.ndarray, labels: np.ndarray) -> bool:
    """Whole in view, and its colours mostly read as they are."""
    glove, named = true > 0, labels > 0
    agree = (true == labels) & glove
    return (
        not on_the_rim(true)
        and agree.sum() >= RIGHT_LABELS * glove.sum()
        and agree.sum() >= RIGHT_LABELS * named.sum()
    )
