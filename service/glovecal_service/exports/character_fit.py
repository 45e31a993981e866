"""How well a character or a robot shows a motion: its bones, its fingertips, and which touches are kept."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from glovecal_models.errors import BadInput
from glovecal_models.hand.bones import HandBones
from glovecal_models.hand.retargeting.bone_names import BONES_AND_TIPS
from glovecal_models.hand.retargeting.touches import TOUCHING_MM
from glovecal_service.exports.body_motion import whole_angles
from glovecal_service.exports.hand_motion import HandMotion
from glovecal_service.exports.onto import Shown

MOST_CHOICES = 500
MOST_FRAMES = 500
"""Of a motion that are looked at, evenly over it."""
LOST_MM = 10.0
"""A touch is lost where the character's fingertips stand further apart than the hand's by this, in the hand's
size."""
FIST_DEG = {"MCP": 85.0, "PIP": 100.0, "DIP": 65.0}
_SIZE, _VIEW = 150, ((0.0, 1.0, 0.25), (-1.0, 0.0, 0.35))
"""Of one hand's picture, pixels; across and down in terms of the hand's axes."""


@dataclass(frozen=True)
class CharacterFit:
    """Of one hand."""

    hand: str
    bones: dict[str, str]
    """The character's bone by the hand's."""
    missing: tuple[str, ...]
    """The hand's bones that the character lacks."""
    choices: tuple[str, ...]
    """Names of bones that could be meant instead, ``MOST_CHOICES`` at most."""
    fingertip_mm: float
    """Root mean square over frames and fingers: from where the hand has its tips, seen from the wrist, in the
    hand's size."""
    touches: int
    """Frames in which the thumb touches a finger."""
    lost: int
    """Of these, in which the character's do not."""
    picture: str
    """SVG: flat hand, fist, and the closest touch, of the hand and of the character."""

    @classmethod
    def of(cls, motion: HandMotion, shown: Shown) -> CharacterFit:
        """Raises BadInput where nothing is calibrated, and where no finger has all its bones."""
        motion.require_angles("angles")
        if not shown.fingers:
            raise BadInput("no finger of the character has all its bones; look at which bone is which")
        step = max(1, len(motion.time_s) // MOST_FRAMES)
        angles = whole_angles(motion.frames(slice(None, None, step)))
        own, other = shown.own_joints_mm(angles), shown.shown_joints_mm(angles)
        away = np.linalg.norm(own[:, :, -1] - other[:, :, -1], axis=2)
        mapping, names = shown.mapping, HandBones.of(motion.skeleton).names
        near, lost, closest = _touched(shown, own, other)
        return cls(
            motion.skeleton.hand, {name: mapping[name] for name in BONES_AND_TIPS if name in mapping},
            tuple(name for name in names if name not in mapping), tuple(shown.choices[:MOST_CHOICES]),
            float(np.sqrt((away**2).mean())), int(near.sum()), int(lost.sum()),
            _picture(shown, angles[closest]),
        )  # fmt: skip


def _touched(shown: Shown, own: np.ndarray, other: np.ndarray) -> tuple[np.ndarray, np.ndarray, int]:
    """(N,) whether thumb and a finger touch, (N,) whether that is lost, and the closest frame."""
    fingers = list(shown.fingers)
    if "thumb" not in fingers or len(fingers) < 2:
        return np.zeros(len(own), bool), np.zeros(len(own), bool), 0
    thumb = fingers.index("thumb")
    gaps, others = (
        np.linalg.norm(np.delete(each[:, :, -1] - each[:, [thumb], -1], thumb, axis=1), axis=2)
        for each in (own, other)
    )
    near = gaps < TOUCHING_MM
    lost = near & (others > gaps + LOST_MM)
    return near.any(axis=1), lost.any(axis=1), int(gaps.min(axis=1).argmin())


def _picture(shown: Shown, closest: np.ndarray) -> str:
    """Palm frames: what is drawn does not depend on how the character stands."""
    rotations = shown.skeleton.rotations
    flat = np.zeros(len(rotations))
    fist = flat.copy()
    for at, name in enumerate(rotations):
        if name[0] != "T":
            fist[at] = FIST_DEG.get(name.partition("_")[2], 0.0)
    angles = np.stack([flat, fist, closest])
    rows = [
        ("hand", shown.own_joints_mm(angles)),
        ("shown", shown.shown_joints_mm(angles)),
    ]
    size = shown.skeleton.dimensions.hand_length_mm
    parts = []
    for row, (name, joints) in enumerate(rows):
        seen = joints @ shown.palm
        for column, pose in enumerate(("flat", "fist", "closest touch")):
            x, y = column * _SIZE, row * (_SIZE + 20)
            parts.append(f'<text x="{x + 6}" y="{y + 14}" font-size="12">{name}, {pose}</text>')
            for finger in seen[column]:
                line = np.concatenate([np.zeros((1, 3)), finger]) @ np.array(_VIEW).T
                line *= (_SIZE - 40) / size
                places = " ".join(
                    f"{x + _SIZE / 2 - u:.1f},{y + _SIZE - 5 + v:.1f}" for u, v in line.tolist()
                )
                parts.append(
                    f'<polyline points="{places}" fill="none" stroke="currentColor" stroke-width="4" '
                    f'stroke-linejoin="round" stroke-linecap="round" opacity="0.75"/>'
                )
    width, height = 3 * _SIZE, 2 * (_SIZE + 20)
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" width="{width}" '
        f'height="{height}" role="img" aria-label="The hand, and how it is shown: flat, fist, closest touch" '
        f'fill="currentColor">{"".join(parts)}</svg>'
    )
