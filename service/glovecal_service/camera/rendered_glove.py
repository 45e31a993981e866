"""A glove that opens and closes and turns before a camera that is not there: every picture is drawn.

For trying the chain and the studio without a camera. The motion repeats, and each picture of a round is drawn
once: then drawing takes no time from tracking.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from glovecal_models.colour_glove.camera_model import Camera
from glovecal_models.colour_glove.drawn.photograph import Photographer, Photography
from glovecal_models.colour_glove.hand_state import HandState
from glovecal_models.colour_glove.pose.window_view import PrintedHand
from glovecal_models.colour_glove.pose_set import hand_shapes

ROUND_S, RATE_HZ = 4.0, 30.0
SHAPES = ("B", "5", "A", "L")
"""Of finger spelling; the hand goes through them in a round."""
DISTANCE_MM = 480.0
_UPRIGHT = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
"""Fingers upwards in the picture, the palm towards the camera."""
LOOK = Photography(clutter=True, face=True, arm="sleeve")
ROOM = 3
"""Seed of what is behind the hand, and of the lamp."""


class RenderedGlove:
    """Pictures of a hand by the seconds since it began."""

    def __init__(self, hand: PrintedHand, camera: Camera) -> None:
        self._photographer = Photographer(hand.skin, hand.pattern, camera, LOOK, ROOM)
        shapes = hand_shapes()
        self._shapes = np.array([shapes[name] for name in SHAPES])
        self._drawn: dict[int, np.ndarray] = {}

    def state(self, time_s: float) -> HandState:
        """Where the hand is then."""
        way = time_s / ROUND_S % 1.0
        step, share = divmod(way * len(SHAPES), 1.0)
        share = 0.5 - 0.5 * np.cos(np.pi * share)
        here, there = self._shapes[int(step)], self._shapes[(int(step) + 1) % len(SHAPES)]
        angles = (1 - share) * here + share * there
        swing = 2 * np.pi * way
        tilt = Rotation.from_euler("xyz", [15 * np.sin(swing), 25 * np.cos(swing), 12 * np.sin(swing)], True)
        turn = tilt.as_matrix() @ _UPRIGHT
        place = np.array([40 * np.sin(swing), 80 + 15 * np.cos(swing), DISTANCE_MM + 30 * np.sin(swing)])
        return HandState(angles, turn, place).within_range()

    def draw(self, time_s: float) -> np.ndarray:
        """(H, W, 3) uint8, blue, green, red."""
        number = round(time_s * RATE_HZ) % round(ROUND_S * RATE_HZ)
        if number not in self._drawn:
            state = self.state(number / RATE_HZ)
            self._drawn[number] = self._photographer.photograph(state, number=number).picture
        return self._drawn[number]
