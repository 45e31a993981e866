"""What is said about pictures that cannot be tracked. Flat colours; photographs: test_picture_check_rates."""

from collections import Counter
from dataclasses import replace

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from lit_glove import HARD, SOFT, LitGlove, a_light, free_motion, other_camera
from worn_glove import family

from glovecal_models.colour_glove.camera_model import Camera
from glovecal_models.colour_glove.database import PoseDatabase, palm_centre
from glovecal_models.colour_glove.hand_state import HandState
from glovecal_models.colour_glove.lookup import PoseLookup, pca_code
from glovecal_models.colour_glove.pattern import (
    PRINTED_SRGB,
    Pattern,
    encoded_light,
    glove_pattern,
    linear_light,
)
from glovecal_models.colour_glove.photograph import hand_motion
from glovecal_models.colour_glove.pictures.picture_check import (
    KINDS,
    Finding,
    PictureCheck,
    light_advice,
    shadowed,
)
from glovecal_models.colour_glove.rasterise import rasterise
from glovecal_models.colour_glove.skin import HandSkin, hand_skin, posed
from glovecal_models.errors import BadInput
from glovecal_models.hand.skeleton import hand_skeleton

SKIN = hand_skin()
LEFT = hand_skin(hand_skeleton(hand="left"))
PATTERN = glove_pattern(SKIN)
CAMERA = Camera()
_HSV = np.array([[(18 * ink, 200, 60 + 190 * (ink % 2)) for ink in range(10)]], np.uint8)
INKS = np.vstack([[(128, 128, 128)], cv2.cvtColor(_HSV, cv2.COLOR_HSV2BGR)[0]])
BEHIND = HandState(np.zeros(20), np.eye(3), np.array([0.0, 0.0, -500.0]))
SHUFFLED = replace(PATTERN, colour_of_patch=np.roll(PATTERN.colour_of_patch, 3))


@pytest.fixture(scope="module")
def check(database: PoseDatabase) -> PictureCheck:
    return PictureCheck(PoseLookup(database, pca_code(database.transforms)))


def seen(state: HandState, skin: HandSkin = SKIN, pattern: Pattern = PATTERN) -> np.ndarray:
    """Labels without a photograph's faults."""
    return rasterise(posed(skin, state), skin.triangles, CAMERA).painted(pattern.colour)


def at(state: HandState, across: float, down: float = 0.0, depth: float = 450.0) -> HandState:
    """The same hand with its palm's centre there, mm."""
    there = np.array([across, down, depth]) - state.rotation @ palm_centre(SKIN)
    return HandState(state.angles_deg, state.rotation, there)


HANDS = [at(state, 0.0) for state in hand_motion(SKIN, 12.0, 0.5, seed=70)]


def told(check: PictureCheck, labels: np.ndarray, light: float = 1.0) -> list[str]:
    found = check.findings(np.clip(INKS[labels] * light, 0, 255).astype(np.uint8), labels)
    for finding in found:
        assert finding.kind in KINDS
        assert is_beyond(finding)
    return [finding.kind for finding in found]


def is_beyond(finding: Finding) -> bool:
    low = finding.kind in ("under-exposed", "no hand", "mirrored")
    return finding.value < finding.limit if low else finding.value > finding.limit


def test_a_hand_in_its_glove_is_right(check):
    for state in HANDS:
        assert told(check, seen(state)) == []


def test_each_fault_is_named(check):
    for state in HANDS:
        labels, beside = seen(at(state, -110.0)), seen(at(state, 110.0), LEFT)
        assert told(check, np.where(labels > 0, labels, beside)) == ["two hands"]
        assert told(check, seen(state, pattern=SHUFFLED)) == ["another glove"]
        assert "cut off" in told(check, seen(at(state, -275.0)))
        assert told(check, seen(state), 0.4) == ["under-exposed"]
        assert told(check, seen(state), 2.5) == ["over-exposed"]
        assert told(check, seen(at(state, 0.0, depth=4000.0))) == ["no hand"]
    assert told(check, seen(BEHIND)) == ["no hand"]


def test_hands_that_touch_are_told_by_their_areas(check):
    found = Counter()
    for state in HANDS:
        labels, before = seen(at(state, -50.0)), seen(at(state, 55.0, depth=420.0), LEFT)
        found.update(told(check, np.where(before > 0, before, labels)))
    assert found["two hands"] >= 5


def test_light_is_the_cause_of_what_follows_from_it(check):
    empty = np.zeros((480, 640), np.uint8)
    for level, kind in ((0, "under-exposed"), (255, "over-exposed"), (128, "no hand")):
        (finding,) = check.findings(np.full((480, 640, 3), level, np.uint8), empty)
        assert finding.kind == kind
    # A room that is dark or bright behind a hand in good light is no fault.
    labels = seen(HANDS[0])
    for level in (0, 255):
        picture = np.where(labels[..., None] > 0, INKS[labels], level).astype(np.uint8)
        assert check.findings(picture, labels) == ()


def test_without_a_look_up_only_the_pattern_is_not_told():
    check = PictureCheck()
    assert check.distance_limit_px2 == float("inf")
    assert told(check, seen(HANDS[0], pattern=SHUFFLED)) == []
    assert told(check, seen(at(HANDS[0], 0.0, depth=4000.0))) == ["no hand"]


def test_the_limit_is_above_what_the_database_leaves_open(check):
    # A hand as it was entered is nearest to itself; the next one is farther, but below the limit.
    database = check.lookup.database
    beyond = [
        check.lookup.neighbours(np.array(database.tiny[entry]), 2).distances[1] > check.distance_limit_px2
        for entry in range(0, 1000, 17)
    ]
    assert np.mean(beyond) < 0.02


@settings(max_examples=100)
@given(
    st.integers(0, 2**32 - 1), st.integers(1, 90), st.integers(1, 90), st.integers(1, 30), st.integers(0, 10)
)
def test_no_picture_breaks_it(check, seed, height, width, block, colours):
    """Blocks of anything, down to a single pixel."""
    rng = np.random.default_rng(seed)
    coarse = (-(-height // block), -(-width // block))
    labels = rng.integers(0, colours + 1, coarse).astype(np.uint8)
    picture = rng.integers(0, 256, (*coarse, 3)).astype(np.uint8)
    labels, picture = (
        np.repeat(np.repeat(array, block, axis=0), block, axis=1)[:height, :width]
        for array in (labels, picture)
    )
    found = check.findings(picture, labels)
    assert len({finding.kind for finding in found}) == len(found)
    for finding in found:
        assert finding.kind in KINDS
        assert is_beyond(finding)
        assert finding.sentence.endswith(".")


def test_what_is_no_picture_is_refused(check):
    picture, labels = np.zeros((40, 50, 3), np.uint8), np.zeros((40, 50), np.uint8)
    for wrong in (picture[..., 0], picture.astype(float)):
        with pytest.raises(BadInput, match="a picture is"):
            check.findings(wrong, labels)
    for wrong in (labels[:20], labels.astype(int)):
        with pytest.raises(BadInput, match="labels"):
            check.findings(picture, wrong)


@pytest.mark.parametrize("strength", [0.15, 0.6, 1.0])
def test_what_is_in_shadow_does_not_depend_on_how_bright_the_room_is(strength: float) -> None:
    """Of each colour the left part has a fifth of the light on the right one."""
    labels = np.tile(np.repeat(np.arange(1, 11, dtype=np.uint8), 20), (200, 1)).T.copy()
    light = linear_light(PRINTED_SRGB[:, ::-1])[labels - 1] * strength
    picture = encoded_light(light)
    assert shadowed(picture, labels) == pytest.approx(0.0, abs=0.02)
    light[:, :60] *= 0.2
    assert shadowed(encoded_light(light), labels) == pytest.approx(0.3, abs=0.03)
    assert shadowed(picture, np.zeros_like(labels)) is None


@pytest.mark.parametrize(("kind", "advised"), [(SOFT, False), (HARD, True)])
def test_light_from_two_lamps_alone_is_advised_against(kind: str, advised: bool) -> None:
    """On gloves of seeds that the limit was not chosen on, by another program's pictures."""
    shares = []
    for number, glove in enumerate(family(2, 9300)):
        room = LitGlove(glove, other_camera(1), a_light(kind, 9300 + number), 9300 + number)
        for index, moment in enumerate(zip(*free_motion(12.0, 0.5, 9300 + number), strict=True)):
            picture, truth = room.picture(*moment, index)
            share = shadowed(picture, truth)
            shares += [] if share is None else [share]
    said = light_advice(shares)
    assert bool(said) == advised, f"{np.mean(shares):.2f} in shadow"
    assert not advised or "Light it from all sides" in said
    assert light_advice(shares[:5]) == ""
