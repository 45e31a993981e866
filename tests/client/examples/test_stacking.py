"""Blocks on a desk: a hand from a real stream builds a pyramid of six, and the physics is real."""

from __future__ import annotations

import numpy as np
import pytest
from blocks.building_hand import HOLDING_DEG, OPEN_DEG, PYRAMID_MM, START_MM, BuildingHand
from blocks.desk import EDGE_MM, TIP_RADIUS_MM, Desk, pinch_mm
from blocks.picture import desk_drawing
from hands_over_zenoh import hands_over_zenoh
from stack import REACH_MM, MovedPinch

FAR_MM = np.array([0.0, -300.0, 300.0])
PUT_MM, STANDS_MM, FALLS_MM = 4.0, 1.0, 20.0


def wait(desk: Desk, seconds: float) -> np.ndarray:
    """Where the blocks are after some time without a hand near, (6, 3)."""
    for _ in range(round(60 * seconds)):
        desk.advance(1 / 60, FAR_MM, OPEN_DEG)
    return desk.scene.blocks_mm


def fallen_mm(desk: Desk, taken: int) -> np.ndarray:
    """How far the other blocks come down within 2 s after one is taken away, (5,)."""
    before = wait(desk, 0.5)
    desk.take_away(taken)
    return np.delete((before - wait(desk, 2.0))[:, 2], taken)


def test_a_hand_from_the_stream_builds_a_pyramid_that_stands() -> None:
    builder, desk, before_s = BuildingHand(), Desk(START_MM), 0.0
    for hand in hands_over_zenoh(builder.script, builder.lasts_s + 0.1, rate_hz=30.0):
        place = builder.hand_mm(hand.seconds, hand.angles_deg)
        desk.advance(hand.seconds - before_s, place, hand.angles_deg)
        before_s = hand.seconds
    built = desk.scene.blocks_mm
    np.testing.assert_allclose(built, PYRAMID_MM, atol=PUT_MM)
    assert np.abs(wait(desk, 5.0) - built).max() < STANDS_MM
    assert "<polygon" in desk_drawing(desk.scene).svg()
    assert fallen_mm(desk, 3).max() > FALLS_MM  # the top has lost one of the two that it stood on


def test_a_wide_pyramid_falls_without_the_middle_of_its_base() -> None:
    pitch = EDGE_MM + 22.0
    wide = PYRAMID_MM.copy()
    wide[:, 0] = pitch * np.array([-1, 0, 1, -0.5, 0.5, 0])
    assert np.abs(wait(Desk(wide), 5.0) - wide).max() < STANDS_MM
    assert (fallen_mm(Desk(wide), 1)[2:] > FALLS_MM).all()


def test_only_friction_holds_an_arch() -> None:
    """Blocks that stand close lean on each other without the middle of the base, unless slippery."""
    assert np.abs(fallen_mm(Desk(PYRAMID_MM), 1)).max() < 2.0
    assert fallen_mm(Desk(PYRAMID_MM, friction=1e-4), 1).max() > FALLS_MM


@pytest.mark.parametrize(("friction", "held"), [(0.9, True), (1e-4, False)])
def test_a_pinch_holds_by_friction_and_an_open_hand_lets_fall(friction: float, held: bool) -> None:
    desk = Desk(START_MM, friction)

    def move(seconds: float, height_mm: float, begin: np.ndarray, end: np.ndarray) -> None:
        low = EDGE_MM / 2
        for share in np.linspace(0, 1, round(60 * seconds)):
            angles = begin + share * (end - begin)
            pinch = np.array([*START_MM[0, :2], low + share * (height_mm - low)])
            desk.advance(1 / 60, pinch - pinch_mm(angles), angles)

    move(0.5, EDGE_MM / 2, OPEN_DEG, HOLDING_DEG)
    move(1.0, 100.0, HOLDING_DEG, HOLDING_DEG)
    assert bool(desk.scene.blocks_mm[0, 2] > 90) is held
    assert wait(desk, 1.0)[0, 2] == pytest.approx(EDGE_MM / 2, abs=1.0)


def test_fingers_never_press_through_the_desk() -> None:
    desk = Desk(START_MM)
    for _ in range(60):
        desk.advance(1 / 60, np.array([0.0, 100.0, 0.0]), HOLDING_DEG)
    np.testing.assert_allclose(desk.scene.blocks_mm, START_MM, atol=0.5)
    assert TIP_RADIUS_MM < EDGE_MM / 2


def test_mouse_and_keys_move_the_hand_within_reach() -> None:
    moved = MovedPinch()
    before = moved.pinch_mm.copy()
    moved.take({"kind": "move", "dx": 20, "dy": -10})
    np.testing.assert_allclose(moved.pinch_mm - before, [10.0, 5.0, 0.0])
    moved.take({"kind": "key", "key": "PageDown"})
    moved.take({"kind": "wheel", "dy": 100})
    np.testing.assert_allclose(moved.pinch_mm - before, [10.0, 5.0, -15.0])
    for odd in ({}, {"kind": "move", "dx": "far", "dy": None}, {"kind": "key", "key": ["x"]}, {"kind": 3}):
        moved.take(odd)
    moved.take({"kind": "move", "dx": float("nan"), "dy": float("inf")})
    np.testing.assert_allclose(moved.pinch_mm - before, [10.0, 5.0, -15.0])
    for _ in range(200):
        moved.take({"kind": "wheel", "dy": 500})
    assert moved.pinch_mm[2] == REACH_MM[2, 0]
