"""A surface around the skeleton of a hand, and where it is in a pose: linear blend skinning.

The surface is ours: round cones along the bones, smoothly joined, meshed once on the assumed hand with spread
fingers. A hand with other bones or radii gets the same triangles stretched bone by bone, as one glove fits
several hands; so a pattern is one for all of them. The left hand is the mirror image.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache, cached_property

import numba
import numpy as np

from glovecal_models.colour_glove.hand_state import FINGER_ROTATIONS, HandState
from glovecal_models.errors import BadInput
from glovecal_models.hand.dimensions import ASSUMED_LENGTH_MM
from glovecal_models.hand.forward_kinematics import forward_kinematics
from glovecal_models.hand.rotations import FINGERS, HAND_ROTATIONS
from glovecal_models.hand.skeleton import Skeleton, hand_skeleton, mirrored
from glovecal_models.names import did_you_mean

CELL_MM = 3.6
"""Of the grid that the surface is meshed on: about 5,000 vertices."""
MOST_JOINTS_OF_A_VERTEX = 4
"""That move one vertex."""
_BIND_DEG = {"T_TMC": 20.0, "TI_ABD": 45.0, "T_VIR": 30.0, "IM_ABD": 16.0, "MR_ABD": 16.0, "RP_ABD": 12.0}
"""Fingers apart, so that the grid does not join them; what is not here is 0."""
_SOFTNESS_MM = 2.5
"""Over which a joint's skin passes from one bone to the next."""
_SMOOTHINGS = 6
RADII_MM: dict[str, tuple[float, float]] = {
    "T_metacarpal": (15.0, 12.0), "T_proximal": (11.5, 10.5), "T_distal": (10.5, 8.5),
    "I_metacarpal": (13.5, 12.5), "I_proximal": (10.0, 9.0), "I_middle": (9.0, 8.3), "I_distal": (8.3, 7.2),
    "M_metacarpal": (13.5, 12.5), "M_proximal": (10.0, 9.2), "M_middle": (9.2, 8.4), "M_distal": (8.4, 7.3),
    "R_metacarpal": (13.5, 12.0), "R_proximal": (9.5, 8.7), "R_middle": (8.7, 8.0), "R_distal": (8.0, 7.0),
    "P_metacarpal": (14.0, 11.5), "P_proximal": (8.8, 7.8), "P_middle": (7.8, 7.2), "P_distal": (7.2, 6.3),
    "W_thumbward": (19.0, 18.0), "W_pinkyward": (19.0, 18.0),
}  # fmt: skip
"""Of the assumed hand in the glove, at the beginning and the end of each bone; ours, by the look of hands."""
LAID = ("along", "around", "across", "above")
"""How flesh and cloth about a bone lie aside: along it and, on its surface, around it, as cloth slips and
turns; across it and above it, as a bone lies in its flesh; mm in the frame of the right hand's bone."""


@dataclass(frozen=True, eq=False)
class HandSkin:
    """V vertices and T triangles; each triangle's corners run counter-clockwise seen from outside."""

    skeleton: Skeleton
    vertices_mm: np.ndarray
    """(V, 3) in the palm's frame, at ``rest_deg``."""
    triangles: np.ndarray
    """(T, 3) int32."""
    joints: np.ndarray
    """(V, 4) int32: the joints that move a vertex, heaviest first."""
    weights: np.ndarray
    """(V, 4): theirs, sum 1."""
    rest_deg: np.ndarray
    """(20,)."""

    @cached_property
    def chain(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """For the kernels: parents (J,), offsets (J, 3), turns (J, 3, 3, 3), weights (J, 20)."""
        skeleton = self.skeleton
        parents = np.array([-1 if parent is None else parent for parent in skeleton.parents])
        fingers = [HAND_ROTATIONS.index(name) for name in FINGER_ROTATIONS]
        weights = np.ascontiguousarray(skeleton.weights[:, fingers])
        return parents, skeleton.offsets_mm, np.ascontiguousarray(skeleton.turns), weights

    @cached_property
    def unbound(self) -> tuple[np.ndarray, np.ndarray]:
        """Takes the surface at rest into each joint's frame: matrices (J, 3, 3), offsets (J, 3)."""
        turned, places = joint_frames(*self.chain, self.rest_deg)
        back = np.ascontiguousarray(turned.swapaxes(1, 2))
        return back, -np.einsum("jab,jb->ja", back, places)


def hand_skin(
    skeleton: Skeleton | None = None,
    radii_mm: Mapping[str, tuple[float, float]] | None = None,
    laid_mm: Mapping[str, Sequence[float]] | None = None,
) -> HandSkin:
    """The skin of a hand with a rigid palm; without ``radii_mm`` they grow with the hand's length.

    ``radii_mm`` gives some bones' radii at both ends, ``laid_mm`` how cloth and flesh lie aside about some
    (``LAID``); names are those of ``RADII_MM``. Raises BadInput for an unknown bone, a radius that is not
    above 0, numbers that are not finite, and an arching palm.
    """
    skeleton = hand_skeleton() if skeleton is None else skeleton
    if skeleton.rotations != HAND_ROTATIONS:
        raise BadInput("a skin is made for a hand with a rigid palm; this one's arches")
    grown = skeleton.dimensions.hand_length_mm / ASSUMED_LENGTH_MM
    radii = {name: (low * grown, high * grown) for name, (low, high) in RADII_MM.items()}
    for name, ends in (radii_mm or {}).items():
        if name not in radii:
            raise BadInput(f"a hand has no bone {name!r}; {did_you_mean(name, radii)}")
        if len(ends) != 2 or not all(np.isfinite(ends)) or not min(ends) > 0:
            raise BadInput(f"radii of {name} are {ends}; two numbers above 0 mm are expected")
        radii[name] = (float(ends[0]), float(ends[1]))
    laid = np.zeros((len(radii), len(LAID)))
    for name, aside in (laid_mm or {}).items():
        if name not in radii:
            raise BadInput(f"a hand has no bone {name!r}; {did_you_mean(name, radii)}")
        if len(aside) != len(LAID) or not np.isfinite(aside).all():
            raise BadInput(f"{name} lies aside by {aside}; {len(LAID)} finite numbers are expected, mm")
        laid[list(radii).index(name)] = aside
    template = _template()
    right = skeleton if skeleton.hand == "right" else mirrored(skeleton)
    vertices = _stretched(template, _bones(right, radii), laid)
    triangles = template.triangles
    if skeleton.hand == "left":
        vertices, triangles = vertices * (1.0, -1.0, 1.0), np.ascontiguousarray(triangles[:, ::-1])
    return HandSkin(skeleton, vertices, triangles, template.joints, template.weights, _rest())


def posed(skin: HandSkin, state: HandState) -> np.ndarray:
    """The vertices (V, 3) in the camera's frame, mm."""
    turned, places = joint_frames(*skin.chain, state.angles_deg)
    back, offsets = skin.unbound
    return skinned(
        skin.vertices_mm, skin.joints, skin.weights, turned, places, back, offsets, state.rotation,
        state.position_mm,
    )  # fmt: skip


def configured(skin: HandSkin, angles_deg: np.ndarray, every: int = 1) -> np.ndarray:
    """Every ``every``-th vertex of many hands (N, 20) in the palm's frame, (N, V', 3) mm."""
    body = [array[::every].copy() for array in (skin.vertices_mm, skin.joints, skin.weights)]
    angles = np.ascontiguousarray(angles_deg, dtype=float)
    found = np.empty((len(angles), len(body[0]), 3))
    _configure(skin.chain, (body[0], body[1], body[2]), skin.unbound, angles, found)
    return found


# A kernel kept on disk is compiled anew when its own file changes, not when another does: here and beside,
# kernels use nothing but their own file (test_colour_glove_kernels).
@numba.njit(cache=True)
def joint_frames(parents, offsets, turns, weights, angles_deg):  # type: ignore[no-untyped-def]
    """Kernel: orientations (J, 3, 3) and places (J, 3) of all joints; ``forward_kinematics`` for one hand."""
    count = len(parents)
    turned, places = np.empty((count, 3, 3)), np.empty((count, 3))
    for joint in range(count):
        angle = 0.0
        for rotation in range(len(angles_deg)):
            angle += weights[joint, rotation] * angles_deg[rotation]
        angle = np.radians(angle)
        sine, rest = np.sin(angle), 1.0 - np.cos(angle)
        parent = parents[joint]
        for a in range(3):
            place = offsets[joint, a]
            if parent >= 0:
                place = places[parent, a]
                for b in range(3):
                    place += turned[parent, a, b] * offsets[joint, b]
            places[joint, a] = place
        for a in range(3):
            for c in range(3):
                total = 0.0
                for b in range(3):
                    own = turns[joint, 0, b, c] + sine * turns[joint, 1, b, c] + rest * turns[joint, 2, b, c]
                    if parent >= 0:
                        total += turned[parent, a, b] * own
                    elif a == b:
                        total += own
                turned[joint, a, c] = total
    return turned, places


@numba.njit(cache=True)
def skinned(vertices, joints, weights, turned, places, back, offsets, rotation, position):  # type: ignore[no-untyped-def]
    # Written out: a call of a library costs more than a product of 3 x 3.
    carried = np.empty((len(places), 3, 4))
    for joint in range(len(places)):
        for a in range(3):
            for b in range(3):
                carried[joint, a, b] = 0.0
            carried[joint, a, 3] = position[a]
        for a in range(3):
            for c in range(3):
                palm = 0.0
                for b in range(3):
                    palm += rotation[a, b] * turned[joint, b, c]
                for b in range(3):
                    carried[joint, a, b] += palm * back[joint, c, b]
                carried[joint, a, 3] += palm * offsets[joint, c] + rotation[a, c] * places[joint, c]
    found = np.empty_like(vertices)
    for vertex in range(len(vertices)):
        x, y, z = vertices[vertex, 0], vertices[vertex, 1], vertices[vertex, 2]
        at_x, at_y, at_z = 0.0, 0.0, 0.0
        for place in range(joints.shape[1]):
            weight = weights[vertex, place]
            if weight == 0.0:  # heaviest first
                break
            j = joints[vertex, place]
            at_x += weight * (
                carried[j, 0, 0] * x + carried[j, 0, 1] * y + carried[j, 0, 2] * z + carried[j, 0, 3]
            )
            at_y += weight * (
                carried[j, 1, 0] * x + carried[j, 1, 1] * y + carried[j, 1, 2] * z + carried[j, 1, 3]
            )
            at_z += weight * (
                carried[j, 2, 0] * x + carried[j, 2, 1] * y + carried[j, 2, 2] * z + carried[j, 2, 3]
            )
        found[vertex, 0], found[vertex, 1], found[vertex, 2] = at_x, at_y, at_z
    return found


@numba.njit(cache=True)
def _configure(chain, body, unbound, angles, found):  # type: ignore[no-untyped-def]
    vertices, joints, weights = body
    back, offsets = unbound
    for index in range(len(angles)):
        turned, places = joint_frames(chain[0], chain[1], chain[2], chain[3], angles[index])
        found[index] = skinned(
            vertices, joints, weights, turned, places, back, offsets, np.eye(3), np.zeros(3)
        )


@dataclass(frozen=True)
class _Bone:
    """A round cone in the palm's frame at rest."""

    name: str
    joint: int
    frame: np.ndarray
    """(3, 3): columns are its axes, x along the bone."""
    start_mm: np.ndarray
    length_mm: float
    radii_mm: tuple[float, float]

    @property
    def is_of_palm(self) -> bool:
        return self.name[0] != "T" and self.name.endswith(("metacarpal", "ward"))

    def distance(self, points: np.ndarray) -> np.ndarray:
        """Of points (N, 3) to the surface, negative inside (N,); mm, nearly."""
        arm = points - self.start_mm
        along = np.clip(arm @ self.frame[:, 0] / self.length_mm, 0.0, 1.0)
        away = np.linalg.norm(arm - np.outer(along * self.length_mm, self.frame[:, 0]), axis=1)
        return away - (self.radii_mm[0] + along * (self.radii_mm[1] - self.radii_mm[0]))


@dataclass(frozen=True)
class _Template:
    bones: tuple[_Bone, ...]
    vertices_mm: np.ndarray
    triangles: np.ndarray
    bone_weights: np.ndarray
    """(V, B)."""
    joints: np.ndarray
    weights: np.ndarray


def _rest() -> np.ndarray:
    return np.array([_BIND_DEG.get(name, 0.0) for name in FINGER_ROTATIONS])


def _bones(skeleton: Skeleton, radii: Mapping[str, tuple[float, float]]) -> tuple[_Bone, ...]:
    """Of the right hand at rest, in the order of ``RADII_MM``."""
    angles = [_BIND_DEG.get(name, 0.0) for name in HAND_ROTATIONS]
    frames = forward_kinematics(skeleton, np.array([angles]))
    place = {joint.name: index for index, joint in enumerate(skeleton.joints)}
    where, tips = frames.joints_mm[0], frames.tips_mm[0]
    length, breadth = (skeleton.dimensions.sizes_mm[f"hand_{size}"] for size in ("length", "breadth"))
    ends: dict[str, tuple[str, np.ndarray, np.ndarray]] = {}
    for index, finger in enumerate(FINGERS):
        names = (
            ("T_VIR", "T_MCP", "T_IP") if finger == "T" else [f"{finger}_{j}" for j in ("MCP", "PIP", "DIP")]
        )
        stops = [*(where[place[name]] for name in names), tips[index]]
        parts = ("metacarpal", "proximal", "distal") if finger == "T" else ("proximal", "middle", "distal")
        for part, joint, start, stop in zip(parts, names, stops, stops[1:], strict=False):
            ends[f"{finger}_{part}"] = (joint, start, stop)
        if finger != "T":  # from the carpals, which lie closer together than the knuckles
            ends[f"{finger}_metacarpal"] = ("W_FLEX", stops[0] * (0.25, 0.7, 0.0), stops[0])
    for side, name in ((1.0, "W_thumbward"), (-1.0, "W_pinkyward")):
        y = 0.13 * side * breadth
        ends[name] = ("W_FLEX", np.array([-0.08 * length, y, 0.0]), np.array([0.10 * length, y, 0.0]))
    starts, stops = (np.array([ends[name][end] for name in radii]) for end in (1, 2))
    joints = [place[ends[name][0]] for name in radii]
    lengths = np.linalg.norm(stops - starts, axis=1)
    along = (stops - starts) / lengths[:, None]
    across = np.cross(frames.orientations[0, joints][:, :, 2], along)
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    turned = np.stack([along, across, np.cross(along, across)], axis=2)
    return tuple(
        # A tip is where its flesh ends: the cone stops a radius before.
        _Bone(name, joint, frame, start, length - (radius[1] if name.endswith("distal") else 0.0), radius)
        for (name, radius), joint, frame, start, length in zip(
            radii.items(), joints, turned, starts, lengths.tolist(), strict=True
        )
    )


@cache
def _template() -> _Template:
    """The assumed right hand, meshed."""
    from skimage.measure import marching_cubes  # half a second, once

    bones = _bones(hand_skeleton(), RADII_MM)
    reach = np.array(
        [[*(bone.start_mm), *(bone.start_mm + bone.length_mm * bone.frame[:, 0])] for bone in bones]
    )
    low, high = reach.reshape(-1, 3).min(0) - 25.0, reach.reshape(-1, 3).max(0) + 25.0
    axes = [np.arange(a, b, CELL_MM) for a, b in zip(low, high, strict=True)]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    field = _field(bones, grid.reshape(-1, 3)).reshape(grid.shape[:3])
    vertices, triangles, _, _ = marching_cubes(field, 0.0, spacing=(CELL_MM,) * 3, allow_degenerate=False)
    vertices = np.ascontiguousarray(vertices + low, dtype=float)
    triangles = _outwards(vertices, np.ascontiguousarray(triangles, dtype=np.int32))
    bone_weights = _bone_weights(bones, vertices, triangles)
    by_joint = np.zeros((len(vertices), 1 + max(bone.joint for bone in bones)))
    for column, bone in enumerate(bones):
        by_joint[:, bone.joint] += bone_weights[:, column]
    joints = np.argsort(-by_joint, axis=1, kind="stable")[:, :MOST_JOINTS_OF_A_VERTEX]
    weights = np.take_along_axis(by_joint, joints, axis=1)
    weights[weights < 1e-3] = 0.0
    weights /= weights.sum(axis=1, keepdims=True)
    return _Template(bones, vertices, triangles, bone_weights, joints.astype(np.int32), weights)


def _field(bones: tuple[_Bone, ...], points: np.ndarray) -> np.ndarray:
    """Distance to the hand, negative inside: cones joined with rounded seams."""
    distance = {bone.name: bone.distance(points) for bone in bones}

    def joined(names: list[str], seam_mm: float) -> np.ndarray:
        found = distance[names[0]]
        for name in names[1:]:
            found = _smooth_minimum(found, distance[name], seam_mm)
        return found

    palm = joined([bone.name for bone in bones if bone.is_of_palm], 10.0)
    thumb = joined([name for name in distance if name[0] == "T"], 3.0)
    hand = _smooth_minimum(palm, thumb, 12.0)
    for finger in "IMRP":
        phalanges = joined([f"{finger}_{part}" for part in ("proximal", "middle", "distal")], 2.0)
        hand = _smooth_minimum(hand, phalanges, 4.0)
    return hand


def _smooth_minimum(a: np.ndarray, b: np.ndarray, seam_mm: float) -> np.ndarray:
    """Quadratic within ``seam_mm`` of equality."""
    near = np.maximum(seam_mm - np.abs(a - b), 0.0)
    return np.minimum(a, b) - near**2 / (4 * seam_mm)


def _outwards(vertices: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    a, b, c = (vertices[triangles[:, corner]] for corner in range(3))
    volume = np.einsum("ij,ij->", a, np.cross(b, c))
    return triangles if volume > 0 else np.ascontiguousarray(triangles[:, ::-1])


def _bone_weights(bones: tuple[_Bone, ...], vertices: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """(V, B): by the distance to bones of the palm and of the nearest finger, smoothed over neighbours."""
    from scipy import sparse

    distance = np.column_stack([bone.distance(vertices) for bone in bones])
    owner = np.array(["W" if bone.is_of_palm else bone.name[0] for bone in bones])
    fingers = np.array(list(FINGERS))
    nearest = fingers[np.argmin([distance[:, owner == finger].min(axis=1) for finger in fingers], axis=0)]
    allowed = (owner[None] == "W") | (owner[None] == nearest[:, None])
    close = np.where(allowed, -distance / _SOFTNESS_MM, -np.inf)
    weights = np.exp(close - close.max(axis=1, keepdims=True))
    weights /= weights.sum(axis=1, keepdims=True)
    edges = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    count = len(vertices)
    ones = np.ones(len(edges))
    beside = sparse.csr_matrix((ones, (edges[:, 0], edges[:, 1])), shape=(count, count))
    beside = beside + beside.T
    beside = sparse.diags(1.0 / np.asarray(beside.sum(axis=1)).ravel()) @ beside
    for _ in range(_SMOOTHINGS):
        weights = 0.5 * weights + 0.5 * (beside @ weights)
    return weights


def _stretched(template: _Template, bones: tuple[_Bone, ...], laid_mm: np.ndarray) -> np.ndarray:
    """The template's surface on other bones: along each by its length, across by its radius; then aside by
    ``laid_mm`` (B, 4), of ``LAID``."""
    carried = np.empty((len(bones), 3, 4))
    for column, (old, new) in enumerate(zip(template.bones, bones, strict=True)):
        thicker = sum(new.radii_mm) / sum(old.radii_mm)
        along, around, *across_above = laid_mm[column]
        angle = around / (0.5 * sum(new.radii_mm))
        sine, cosine = np.sin(angle), np.cos(angle)
        turn = np.array([[1.0, 0.0, 0.0], [0.0, cosine, -sine], [0.0, sine, cosine]])
        scaled = np.diag([new.length_mm / old.length_mm, thicker, thicker]) @ old.frame.T
        whole = new.frame @ turn @ scaled
        carried[column, :, :3] = whole
        carried[column, :, 3] = new.start_mm + new.frame @ (along, *across_above) - whole @ old.start_mm
    blended = (template.bone_weights @ carried.reshape(len(bones), 12)).reshape(-1, 3, 4)
    return np.einsum("vab,vb->va", blended[:, :, :3], template.vertices_mm) + blended[:, :, 3]
