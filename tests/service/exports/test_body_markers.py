"""Hands joined to an optical system's markers: placed by arm or back of the hand, wrist by choice."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from glovecal_models.errors import BadInput
from glovecal_models.hand.dimensions import HandDimensions
from glovecal_models.hand.rotations import HAND_ROTATIONS, Handedness
from glovecal_models.hand.skeleton import hand_skeleton
from glovecal_service.exports.body_markers import BodyMarkers, hand_frame, read_trc
from glovecal_service.exports.hand_motion import HandMotion
from glovecal_service.exports.marker_tables import markers, trc_text

TIME_S = np.arange(60) / 60
ARM = {"RAD": (0.0, 30.0, 0.0), "ULN": (0.0, -30.0, 0.0), "ELB": (-250.0, 0.0, 0.0)}
BACK = {"BR": (60.0, 20.0, 0.0), "BU": (60.0, -20.0, 0.0)}


def rotation(axis: int, degrees: float) -> np.ndarray:
    cos, sin = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    turn = np.eye(3)
    one, other = [at for at in range(3) if at != axis]
    turn[[one, one, other, other], [one, other, one, other]] = cos, -sin, sin, cos
    return turn


def motion(hand: Handedness = "right", **changes) -> HandMotion:
    random = np.random.default_rng(0)
    degrees = random.uniform(0, 20, (60, len(HAND_ROTATIONS)))
    skeleton = hand_skeleton(HandDimensions.from_measured({"hand_length": 185.0}), hand)
    label = "L" if hand == "left" else "R"
    empty = np.empty((60, 0))
    return HandMotion(label, TIME_S, (), empty, HAND_ROTATIONS, degrees, degrees, skeleton, **changes)


@pytest.mark.parametrize("hand", ["right", "left"])
def test_a_hand_lies_where_its_forearm_is(hand: Handedness) -> None:
    """Turned and moved with the arm, every joint keeps its place on it."""
    turn, moved = rotation(0, 35.0) @ rotation(2, -50.0), np.array([100.0, 1200.0, 300.0])
    mirror = np.array([1, -1 if hand == "left" else 1, 1])
    seen = {name: np.tile(turn @ (mirror * place) + moved, (60, 1)) for name, place in ARM.items()}
    frame = hand_frame(seen, ("RAD", "ULN", "ELB"), "glove", is_left=hand == "left")
    alone, placed = markers(motion(hand), "joints"), markers(motion(hand, frame=frame), "joints")
    for name, places in alone.items():
        np.testing.assert_allclose(placed[name], places @ turn.T + moved, atol=1e-9)


def test_with_the_optical_wrist_the_gloves_wrist_does_not_matter() -> None:
    """The back of the hand is bent against the arm by 40 degrees, whatever the glove's wrist sensors say."""
    bent = rotation(1, -40.0)
    seen = {name: np.tile(place, (60, 1)) for name, place in ARM.items()}
    seen |= {name: np.tile(bent @ np.array(place), (60, 1)) for name, place in BACK.items()}
    frame = hand_frame(seen, ("RAD", "ULN", "BR", "BU"), "optical", is_left=False)
    still = motion(wrist="optical", frame=frame)
    wrong = np.where([name in ("W_FLEX", "W_ABD") for name in HAND_ROTATIONS], 77.0, still.degrees)
    other = HandMotion(**{**vars(still), "degrees": wrong})
    found, again = markers(still, "joints"), markers(other, "joints")
    for name in found:
        np.testing.assert_allclose(found[name], again[name])
    flat = np.where([name in ("W_FLEX", "W_ABD") for name in HAND_ROTATIONS], 0.0, still.degrees)
    alone = markers(HandMotion(**{**vars(motion()), "degrees": flat}), "joints")
    np.testing.assert_allclose(found["R_middle_mcp"], alone["R_middle_mcp"] @ bent.T, atol=1e-9)


def test_markers_of_the_body_are_read_and_put_onto_the_hands_time(tmp_path: Path) -> None:
    time_s = np.arange(100) / 100
    places = np.column_stack([100 * time_s, 5 * np.ones(100), np.zeros(100)])
    hidden = places.copy()
    hidden[30:60] = np.nan
    path = tmp_path / "body.trc"
    path.write_text(trc_text(time_s, {"C7": places, "ELB": hidden}, "body.trc").replace("\tmm\t", "\tm\t"))
    body = read_trc(path, "body.trc")
    np.testing.assert_allclose(body.places_mm["C7"], 1000 * places, atol=1e-6)
    at = body.at(np.array([0.105, 0.45, 2.0]))
    np.testing.assert_allclose(at["C7"][0], [10500.0, 5000.0, 0.0])
    assert np.isnan(at["ELB"][1]).all(), "nothing is interpolated across a gap of 0.3 s"
    assert np.isnan(at["C7"][2]).all()


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("time,x\n" * 8, "no TRC file"),
        ("PathFileType\t4\nUnits\nfeet\nF\tT\tA\n\n1\t0\t0\t0\t0\n", "unit 'feet' must be one of"),
        ("PathFileType\t4\nUnits\nmm\nF\tT\tA\n\n1\t0\tx\t0\t0\n", "line 6"),
        ("PathFileType\t4\nUnits\nmm\nF\tT\tA\n\n1\t0\t0\t0\t0\n", "two frames or more"),
    ],
)
def test_what_is_no_trc_is_told_by_line(tmp_path: Path, text: str, says: str) -> None:
    (tmp_path / "x.trc").write_text(text)
    with pytest.raises(BadInput, match=says):
        read_trc(tmp_path / "x.trc", "x.trc")


def test_markers_that_are_not_there_are_named() -> None:
    body = BodyMarkers(TIME_S, {name: np.tile(place, (60, 1)) for name, place in ARM.items()})
    with pytest.raises(BadInput, match="no marker 'ELBOW'; did you mean 'ELB'"):
        hand_frame(body.places_mm, ("RAD", "ULN", "ELBOW"), "glove", is_left=False)
    with pytest.raises(BadInput, match="needs the markers wrist at the thumb's side"):
        hand_frame(body.places_mm, ("RAD", "ULN"), "optical", is_left=False)
