"""Hands and gloves that are not the model's: what the tracker's errors are learned on.

A model's hand errs by its bones and radii, by its joints' axes, which no hand has exactly where an atlas puts
them (A. Hollister et al. 1992, "The axes of rotation of the thumb carpometacarpal joint", J. Orthopaedic
Research 10, 454-460, and others find them tilted by several degrees from person to person), and by where the
cloth lies: a seam is sewn aside, a finger too short, cloth stretches and gathers in wrinkles.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from glovecal_models.colour_glove.pattern import Pattern
from glovecal_models.colour_glove.pose.hand_shape_fit import BONES_SD, RADII_SD
from glovecal_models.colour_glove.skin import RADII_MM, HandSkin, hand_skin
from glovecal_models.hand.dimensions import HandDimensions
from glovecal_models.hand.skeleton import Skeleton, hand_skeleton

_LAID_MM, _LAID_WAVE_MM = (1.0, 4.0), (60.0, 160.0)
"""How far the cloth lies aside along each axis, root mean square, from glove to glove; over which lengths."""
_WRINKLES_MM, _WRINKLE_WAVE_MM = (0.3, 1.5), (15.0, 45.0)
_WAVES = 6
_SADDLE = ("T_TMC", "TI_ABD", "T_VIR")
_SIDE_MM = 8.0
"""Of a normal's unit: so that cloth of one side of a finger is not found on the other."""


@dataclass(frozen=True)
class ShapeSpread:
    """Standard deviations of hands about their model, relative but for the axes; by default those between
    people."""

    bones: float = BONES_SD
    radii: float = RADII_SD
    overall: float = 0.02
    axes_deg: float = 4.0
    """Of each joint's axis, about each of three directions; twice that of the thumb's first joint."""


PEOPLE = ShapeSpread()
"""Of hands whose shape was not fitted."""


def other_hand(skin: HandSkin, seed: int, spread: ShapeSpread = PEOPLE) -> HandSkin:
    """A hand like ``skin``'s but for bones, radii, size and axes: what this hand's model may be wrong by."""
    rng = np.random.default_rng([seed, 3])
    sizes, grown = skin.skeleton.dimensions.sizes_mm, 1.0 + spread.overall * rng.standard_normal()
    whole = ("hand_length", "hand_breadth")
    changed = {
        name: float(size * grown * (1.0 if name in whole else 1.0 + spread.bones * rng.standard_normal()))
        for name, size in sizes.items()
    }
    skeleton = hand_skeleton(HandDimensions.from_measured(changed), skin.skeleton.hand)
    share = skeleton.dimensions.hand_length_mm / hand_skin().skeleton.dimensions.hand_length_mm
    thicker = {name: 1.0 + spread.radii * rng.standard_normal() for name in RADII_MM}
    radii = {
        name: (low * share * thicker[name], high * share * thicker[name])
        for name, (low, high) in RADII_MM.items()
    }
    return hand_skin(_tilted(skeleton, spread.axes_deg, rng), radii)


def _tilted(skeleton: Skeleton, axes_deg: float, rng: np.random.Generator) -> Skeleton:
    joints = []
    for joint in skeleton.joints:
        tilt = np.radians(axes_deg) * (2.0 if joint.name in _SADDLE else 1.0)
        axis = np.array(joint.axis) + tilt * rng.standard_normal(3)
        x, y, z = (axis / np.linalg.norm(axis)).tolist()
        joints.append(replace(joint, axis=(x, y, z)))
    return replace(skeleton, joints=tuple(joints))


def displaced(skin: HandSkin, pattern: Pattern, seed: int) -> Pattern:
    """The pattern as it lies on a hand that it was not sewn for: aside by some mm, and wrinkled."""
    from scipy.spatial import KDTree

    rng = np.random.default_rng([seed, 6])
    a, b, c = (skin.vertices_mm[skin.triangles[:, corner]] for corner in range(3))
    centres, across = (a + b + c) / 3.0, np.cross(b - a, c - a)
    normals = across / (np.linalg.norm(across, axis=1, keepdims=True) + 1e-12)
    aside = np.zeros_like(centres)
    for sizes, waves in ((_LAID_MM, _LAID_WAVE_MM), (_WRINKLES_MM, _WRINKLE_WAVE_MM)):
        field = np.zeros_like(centres)
        for _ in range(_WAVES):
            wave = rng.standard_normal(3)
            wave *= 2.0 * np.pi / rng.uniform(*waves) / np.linalg.norm(wave)
            phase = np.cos(centres @ wave + rng.uniform(0.0, 2.0 * np.pi))
            field += phase[:, None] * rng.standard_normal(3)
        aside += field * rng.uniform(*sizes) / np.sqrt(np.square(field).mean())
    places = KDTree(np.hstack([centres, _SIDE_MM * normals]))
    _, nearest = places.query(np.hstack([centres + aside, _SIDE_MM * normals]))
    return replace(pattern, patch=np.ascontiguousarray(pattern.patch[nearest]))
