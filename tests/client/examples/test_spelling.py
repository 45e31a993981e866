"""Finger spelling: the nearest letter, text out of a real stream, and the confusion table."""

from __future__ import annotations

import numpy as np
import pytest
from hands_over_zenoh import hands_over_zenoh
from hypothesis import given, settings
from hypothesis import strategies as st
from spell import alphabet_drawing
from spelling.alphabet import HARD, LETTERS, LETTERS_DEG, REST_ANGLES_DEG, SAME_SHAPE
from spelling.confusion import picture, simulated_confusion, table
from spelling.nearest_letter import letter_distances, nearest_letter
from spelling.speller import Speller
from spelling.spelling_hand import spelling_hand

from glovecal_models.hand.rotations import HAND_ROTATIONS

ALL = np.ones(len(HAND_ROTATIONS), bool)
SD = np.full(len(HAND_ROTATIONS), 2.0)


def spelled(text: str, **more) -> str:
    script, lasts_s = spelling_hand(text)
    speller = Speller()
    for hand in hands_over_zenoh(script, lasts_s, **more):
        speller.follow(hand)
    return speller.text


def test_every_letter_is_itself_and_the_relaxed_hand_is_none() -> None:
    for letter, angles in zip(LETTERS, LETTERS_DEG, strict=True):
        assert nearest_letter(angles, SD, ALL).letter == letter
    assert nearest_letter(REST_ANGLES_DEG, SD, ALL).letter is None
    assert nearest_letter(np.full(len(HAND_ROTATIONS), 200.0), SD, ALL).letter is None
    with pytest.raises(ValueError, match="no rotation"):
        nearest_letter(REST_ANGLES_DEG, SD, ~ALL)


def test_letters_that_differ_in_the_wrist_alone_are_those_that_are_named() -> None:
    fingers = ALL.copy()
    fingers[-2:] = False
    between = letter_distances(LETTERS_DEG, np.tile(SD, (len(LETTERS), 1)), fingers)[:, :-1]
    same = {LETTERS[a] + LETTERS[b] for a, b in np.argwhere(between == 0) if a < b}
    assert same == {"".join(sorted(pair)) for pair in SAME_SHAPE}


@settings(max_examples=40)
@given(st.integers(0, 23), st.integers(0, len(HAND_ROTATIONS) - 1), st.floats(-60, 60))
def test_an_uncertain_joint_counts_less(letter: int, joint: int, error: float) -> None:
    hand = LETTERS_DEG[letter].copy()
    hand[joint] += error
    sure, unsure = SD.copy(), SD.copy()
    unsure[joint] = 1e4
    assert nearest_letter(hand, unsure, ALL).distance <= nearest_letter(hand, sure, ALL).distance + 1e-12


@pytest.mark.parametrize("text", ["HELLO WORLD", "SUM TO FEE"])
def test_text_comes_out_of_a_stream(text: str) -> None:
    assert spelled(text, sd_deg=1.0) == text


def test_a_letter_passed_on_the_way_or_held_long_does_not_repeat() -> None:
    script, lasts_s = spelling_hand("A")
    speller = Speller()
    for hand in hands_over_zenoh(lambda now: script(min(now, 0.8)), lasts_s + 2.0, sd_deg=1.0):
        speller.follow(hand)
    assert speller.text == "A"


def test_what_cannot_be_spelled_is_refused() -> None:
    with pytest.raises(ValueError, match="'J' cannot be spelled"):
        spelling_hand("jazz")


def test_confusion_adds_up_and_the_hidden_thumb_makes_the_hard_letters_hard() -> None:
    glove = simulated_confusion(5.0, signers=12)
    camera = simulated_confusion(8.0, 20.0, signers=12)
    np.testing.assert_allclose(camera.rates.sum(axis=2), 1.0)
    rate, low, high = camera.right()
    assert low < rate < high <= 1
    assert glove.right(HARD)[1] > camera.right(HARD)[2]
    assert camera.right(HARD)[2] < camera.right("".join(set(LETTERS) - set(HARD)))[1]
    no_wrist = simulated_confusion(5.0, wrist=False, signers=12).mean
    for first, second in SAME_SHAPE:
        pair = [LETTERS.index(first), LETTERS.index(second)]
        assert no_wrist[pair, pair].sum() < 1.1
    assert "U" in table(camera)
    assert picture(camera).svg().count("<polygon") == 24 * 25
    assert alphabet_drawing().svg().count("<text") == 24
