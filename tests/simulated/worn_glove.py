"""A hand that the tracker never saw, in a glove sewn from the printed sheets: to try the tracker on.

Nothing of how the tracker draws hands is used here (``skin``, ``rasterise``, ``photograph``): the hand is
made of tubes swept along bones, which bend in arcs, with webs between the fingers; its joints turn about axes
that are tilted; the cloth is cut from the sheets and lies on the hand as tips and hems hold it. What is
shared is what a user shares: the sheets as they are printed, and the skeleton's document, which says what an
angle means.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache, cached_property

import numpy as np
from scipy.interpolate import RBFInterpolator
from scipy.ndimage import gaussian_filter1d
from scipy.spatial.transform import Rotation, Slerp
from skimage.draw import polygon
from skimage.measure import find_contours

from glovecal_models.colour_glove.pattern import printed_pattern
from glovecal_models.colour_glove.sheets.flat_glove import flat_pieces
from glovecal_models.colour_glove.skin import hand_skin
from glovecal_models.hand.dimensions import HandDimensions
from glovecal_models.hand.skeleton import hand_skeleton, skeleton_document

FINGERS = "TIMRP"
ROTATIONS = (
    "T_TMC", "TI_ABD", "T_VIR", "T_MCP", "T_IP", "I_MCP", "I_PIP", "I_DIP", "IM_ABD", "M_MCP", "M_PIP",
    "M_DIP", "MR_ABD", "R_MCP", "R_PIP", "R_DIP", "RP_ABD", "P_MCP", "P_PIP", "P_DIP",
)  # fmt: skip
SHEET_LENGTH_MM = 190.0
_PIXELS_PER_MM = 3.0
_MARGIN_MM = 6.0


# The sheets as printed, one picture a side.


@dataclass(frozen=True, eq=False)
class PrintedSide:
    """Palm's or back's side, as cut out."""

    colours: np.ndarray
    """(H, W) uint8, 0 outside the piece."""
    corner_mm: np.ndarray
    """(2,) of the first pixel."""
    tips_mm: np.ndarray
    """(5, 2), thumb to pinky."""
    crotches_mm: np.ndarray
    """(4, 2), between them."""
    hem_mm: np.ndarray
    """(2, 2), the opening's corners: the thumb's side, the pinky's."""

    def colour_at(self, points_mm: np.ndarray) -> np.ndarray:
        """(N,) uint8: of the nearest place of the piece."""
        place = (points_mm - self.corner_mm) * _PIXELS_PER_MM
        rows = np.clip(place[:, 1].astype(int), 0, self.colours.shape[0] - 1)
        columns = np.clip(place[:, 0].astype(int), 0, self.colours.shape[1] - 1)
        return self._grown[rows, columns]

    @cached_property
    def _grown(self) -> np.ndarray:
        """Beyond the seam the cloth's last colour: it is turned in there."""
        from scipy.ndimage import distance_transform_edt

        nearest = distance_transform_edt(self.colours == 0, return_distances=False, return_indices=True)
        return self.colours[tuple(np.asarray(nearest))]

    def half_widths(self, base: np.ndarray, tip: np.ndarray, share: np.ndarray) -> np.ndarray:
        """(N, 2): from the line base to tip to the seam on either side, at ``share`` of it (1: the tip)."""
        along = (tip - base) / np.linalg.norm(tip - base)
        across = np.array([-along[1], along[0]])
        found = np.empty((len(share), 2))
        steps = np.arange(0.0, 22.0, 1.0 / _PIXELS_PER_MM)
        for row, part in enumerate(np.clip(share, 0.0, 0.985)):
            for side, sign in enumerate((-1.0, 1.0)):
                places = base + part * (tip - base) + sign * steps[:, None] * across
                rows = ((places - self.corner_mm) * _PIXELS_PER_MM).astype(int)
                inside = np.all((rows >= 0) & (rows < self.colours.shape[::-1]), axis=1)
                seen = np.zeros(len(rows), dtype=bool)
                seen[inside] = self.colours[rows[inside, 1], rows[inside, 0]] > 0
                found[row, side] = steps[np.argmin(seen)] if not seen.all() else steps[-1]
        return found


@cache
def printed_sides() -> tuple[PrintedSide, PrintedSide]:
    """Palm's side and back's side of the right glove for a hand of ``SHEET_LENGTH_MM``."""
    pattern = printed_pattern()
    return tuple(_printed(piece, pattern) for piece in flat_pieces(hand_skin(), pattern))  # type: ignore[return-value]


def _printed(piece, pattern) -> PrintedSide:  # type: ignore[no-untyped-def]
    corner = piece.points_mm.min(axis=0) - _MARGIN_MM
    width, height = np.ceil((piece.points_mm.max(axis=0) - corner + _MARGIN_MM) * _PIXELS_PER_MM).astype(int)
    colours = np.zeros((height, width), dtype=np.uint8)
    for corners, patch in zip(piece.triangles, piece.patch, strict=True):
        x, y = ((piece.points_mm[corners] - corner) * _PIXELS_PER_MM).T
        rows, columns = polygon(y, x, shape=colours.shape)
        colours[rows, columns] = pattern.colour_of_patch[patch - 1]
    outline = max(find_contours((colours > 0).astype(float), 0.5), key=len)[:-1, ::-1]
    outline = gaussian_filter1d(outline, 4.0, axis=0, mode="wrap") / _PIXELS_PER_MM + corner
    # Fingers up: tips and crotches are where the outline's distance from the hem's middle turns.
    low = outline[outline[:, 1] > outline[:, 1].max() - 14.0]
    hem = np.array([low[np.argmin(low[:, 0])], low[np.argmax(low[:, 0])]])
    start = int(np.argmin(np.linalg.norm(outline - hem[0], axis=1)))
    outline = np.roll(outline, -start, axis=0)
    if outline[len(outline) // 8, 1] > outline[-len(outline) // 8, 1]:
        outline = outline[::-1]  # from the left end of the hem, up
    away = np.linalg.norm(outline - hem.mean(axis=0), axis=1)
    tips, crotches = _turns(away)
    thumb_first = piece.side == "back"  # fingers up and seen from outside, the back has its thumb on the left
    order = slice(None) if thumb_first else slice(None, None, -1)
    return PrintedSide(
        colours, corner, outline[tips][order], outline[crotches][order], hem if thumb_first else hem[::-1]
    )


def _turns(away: np.ndarray) -> tuple[list[int], list[int]]:
    """Five tips and the four crotches between them."""
    tips: list[int] = []
    reach = len(away) // 40
    for index in np.argsort(-away):
        low, high = max(0, index - reach), min(len(away), index + reach)
        if away[index] == away[low:high].max() and all(abs(index - tip) > reach for tip in tips):
            tips.append(int(index))
        if len(tips) == 5:
            break
    tips.sort()
    return tips, [left + int(np.argmin(away[left:right])) for left, right in itertools.pairwise(tips)]


# The hand.


@dataclass(frozen=True)
class Fit:
    """How a hand and its glove differ from what was printed and assumed; relative unless a unit is named."""

    length_mm: float = 190.0
    bones: float = 0.045
    """Standard deviation of each bone's length."""
    radii: float = 0.06
    tilt_deg: float = 4.0
    """Standard deviation of each axis' tilt, about two directions."""
    seam_mm: float = 4.0
    """By how much the seams lie aside, root mean square."""
    short_mm: float = 3.0
    """How much too short or too long fingers are sewn, standard deviation."""
    wrinkle_mm: float = 1.2
    """Cloth gathered or stretched: root mean square of its places' error."""
    arch_deg: float = 4.0
    """Ring and pinky metacarpals bend in with the fingers: at full flexion of these."""


_RADII = {  # of a glove finger at base, middle joint, last joint, tip's end; shares of the hand's length
    "T": (0.068, 0.060, 0.055, 0.048), "I": (0.056, 0.053, 0.046, 0.040), "M": (0.057, 0.054, 0.047, 0.041),
    "R": (0.054, 0.050, 0.044, 0.038), "P": (0.048, 0.044, 0.039, 0.034),
}  # fmt: skip
_RINGS, _HALF = 26, 13
_WEB = 0.42
"""Of a proximal phalanx: how far from the knuckle the skin between two fingers reaches."""
_ARC_MM = 7.0


@dataclass(frozen=True, eq=False)
class _Joint:
    name: str
    parent: int
    offset: np.ndarray
    turn: np.ndarray
    axis: np.ndarray
    rotations: Mapping[str, float]


@dataclass(frozen=True, eq=False)
class WornGlove:
    """One hand in its glove; the same seed makes the same one."""

    seed: int
    fit: Fit = Fit()

    def posed(self, angles_deg: np.ndarray) -> np.ndarray:
        """(V, 3) mm in the palm's frame, of ``ROTATIONS``' angles (20,)."""
        turns, places = self._frames(angles_deg)
        found = [self._palm()]
        rings = {}
        for finger in FINGERS:
            rings[finger] = self._tube(finger, turns, places)
            found.append(rings[finger].reshape(-1, 3))
        for one, other in ("IM", "MR", "RP"):
            found.append(self._web(rings[one], rings[other]))
        found.append(self._thumb_web(rings["T"], found[0].reshape(_PALM_RINGS, 2 * _HALF, 3)))
        return np.concatenate(found)

    @cached_property
    def triangles(self) -> np.ndarray:
        """(T, 3) int32."""
        found, start = [], 0
        for rows in (_PALM_RINGS, *[_RINGS] * 5):
            for half in range(2):
                first = start + half * _HALF
                for ring in range(rows - 1):
                    for step in range(_HALF - 1):
                        a = first + ring * 2 * _HALF + step
                        b = a + 2 * _HALF
                        found += [(a, b, a + 1), (a + 1, b, b + 1)]
            start += rows * 2 * _HALF
        for _ in range(4):
            for face in range(2):
                for row in range(_WEB_ROWS - 1):
                    for step in range(2):
                        a = start + (face * _WEB_ROWS + row) * 3 + step
                        found += [(a, a + 3, a + 1), (a + 1, a + 3, a + 4)]
            start += 2 * _WEB_ROWS * 3
        return np.array(found, dtype=np.int32)

    @cached_property
    def cloth(self) -> tuple[np.ndarray, np.ndarray]:
        """Of each vertex: whether it is the back's (V,) bool, and its place on the sheet (V, 2) mm."""
        backs, places = [], []
        grown = SHEET_LENGTH_MM / self.fit.length_mm
        flat = self.posed(np.array([_LAID_DEG.get(name, 0.0) for name in ROTATIONS]))
        side_of_ring = np.repeat([False, True], _HALF)
        fingers = {}
        for number, finger in enumerate(FINGERS):
            first = (_PALM_RINGS + number * _RINGS) * 2 * _HALF
            fingers[finger] = flat[first : first + _RINGS * 2 * _HALF].reshape(_RINGS, 2 * _HALF, 3)
        palm = flat[: _PALM_RINGS * 2 * _HALF].reshape(_PALM_RINGS, 2 * _HALF, 3)
        drawn: dict[str, np.ndarray] = {}
        for number, finger in enumerate(FINGERS):
            drawn[finger] = self._finger_cloth(number, finger, fingers[finger], grown)
        backs.append(np.tile(side_of_ring, _PALM_RINGS))
        places.append(self._palm_cloth(palm, fingers, drawn))
        for finger in FINGERS:
            backs.append(np.tile(side_of_ring, _RINGS))
            places.append(drawn[finger].reshape(-1, 2))
        for one, other in ("IM", "MR", "RP"):
            backs.append(np.repeat([False, True], _WEB_ROWS * 3))
            places.append(self._web_cloth(drawn[one], drawn[other]))
        backs.append(np.repeat([False, True], _WEB_ROWS * 3))
        places.append(self._thumb_web_cloth(drawn["T"], places[0].reshape(_PALM_RINGS, 2 * _HALF, 2)))
        back, place = np.concatenate(backs), np.concatenate(places)
        return back, place + self._wrinkles(flat, back)

    def colours(self, back: np.ndarray, place_mm: np.ndarray) -> np.ndarray:
        """(N,) uint8 of places on the cloth."""
        found = np.empty(len(place_mm), dtype=np.uint8)
        for side, printed in zip((False, True), printed_sides(), strict=True):
            found[back == side] = printed.colour_at(place_mm[back == side])
        return found

    # Bones.

    @cached_property
    def sizes_mm(self) -> dict[str, float]:
        rng = np.random.default_rng([self.seed, 31])
        sizes = HandDimensions.from_measured({"hand_length": self.fit.length_mm}).sizes_mm
        return {
            name: size * (1.0 if name == "hand_length" else float(np.exp(self.fit.bones * rng.normal())))
            for name, size in sizes.items()
        }

    @cached_property
    def _joints(self) -> list[_Joint]:
        rng = np.random.default_rng([self.seed, 32])
        document = skeleton_document(hand_skeleton(HandDimensions.from_measured(self.sizes_mm)))
        names = [joint["name"] for joint in document["joints"]]
        found = []
        for joint in document["joints"]:
            w, x, y, z = joint["orientation"]
            tilt = Rotation.from_rotvec(np.radians(self.fit.tilt_deg) * rng.normal(size=3))
            axis = tilt.apply(joint["axis"])
            parent = -1 if joint["parent"] is None else names.index(joint["parent"])
            turn = Rotation.from_quat([x, y, z, w]).as_matrix()
            found.append(
                _Joint(joint["name"], parent, np.array(joint["offset"]), turn, axis, joint["rotations"])
            )
        return found

    @cached_property
    def _tips(self) -> dict[str, np.ndarray]:
        return {finger: np.array([self.sizes_mm[f"{finger}_distal"], 0.0, 0.0]) for finger in FINGERS}

    def _frames(self, angles_deg: np.ndarray) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
        angle: dict[str, float] = dict(zip(ROTATIONS, angles_deg.tolist(), strict=True))
        bent = np.clip((angle["R_MCP"] + angle["P_MCP"]) / 160.0, 0.0, 1.0) * self.fit.arch_deg
        turns: list[np.ndarray] = []
        places: list[np.ndarray] = []
        for joint in self._joints:
            own = sum(weight * angle.get(name, 0.0) for name, weight in joint.rotations.items())
            turned = joint.turn @ Rotation.from_rotvec(np.radians(own) * joint.axis).as_matrix()
            if joint.parent < 0:
                turns.append(turned)
                places.append(joint.offset)
                continue
            place = places[joint.parent] + turns[joint.parent] @ joint.offset
            if joint.name in ("R_ABD", "P_ABD"):
                share = {"R_ABD": 0.5, "P_ABD": 1.0}[joint.name]
                arch = Rotation.from_rotvec(
                    np.radians(share * bent) * np.array([0.25, 0.97, 0.0])
                ).as_matrix()
                place, turned = arch @ place, arch @ turned
            turns.append(turns[joint.parent] @ turned)
            places.append(place)
        names = [joint.name for joint in self._joints]
        return dict(zip(names, turns, strict=True)), dict(zip(names, places, strict=True))

    # Flesh.

    @cached_property
    def _radii(self) -> dict[str, np.ndarray]:
        rng = np.random.default_rng([self.seed, 33])
        whole = np.exp(0.5 * self.fit.radii * rng.normal())
        return {
            finger: self.fit.length_mm
            * whole
            * np.array(shares)
            * np.exp(self.fit.radii * rng.normal(size=4))
            for finger, shares in _RADII.items()
        }

    def _tube(
        self, finger: str, turns: Mapping[str, np.ndarray], places: Mapping[str, np.ndarray]
    ) -> np.ndarray:
        """(_RINGS, 2 _HALF, 3): rings around the finger, the palm's half first."""
        if finger == "T":
            names = ["T_VIR", "T_MCP", "T_IP"]
        else:
            names = [f"{finger}_{joint}" for joint in ("MCP", "PIP", "DIP")]
        corners = np.array(
            [*(places[name] for name in names), places[names[2]] + turns[names[2]] @ self._tips[finger]]
        )
        base = turns["W_FLEX"] if finger != "T" else turns["T_VIR"]
        frames = Rotation.from_matrix([base, *(turns[name] for name in names)])
        bones = np.linalg.norm(np.diff(corners, axis=0), axis=1)
        begin = np.concatenate([[0.0], np.cumsum(bones)])
        radii = self._radii[finger]
        start = -0.15 * bones[0] if finger != "T" else 0.05 * bones[0]
        share = np.linspace(0.0, 1.0, _RINGS) ** 0.85
        # Rings end on the tip's half ball.
        at = start + share * (begin[-1] - start - 0.02 * radii[3])
        middle, turned = self._swept(corners, frames, begin, at)
        ball = begin[-1] - radii[3]
        wide = np.interp(at, [0.0, begin[1], begin[2], ball], radii)
        bulge = sum(0.06 * np.exp(-(((at - joint) / 6.0) ** 2)) for joint in begin[1:3])
        wide = wide * (1.0 + bulge)
        end = at > ball
        wide[end] = radii[3] * np.sqrt(np.maximum(1.0 - ((at[end] - ball) / radii[3]) ** 2, 0.0))
        angle = np.concatenate([np.linspace(-90.0, 90.0, _HALF)] * 2)
        angle = np.radians(angle)
        up = np.repeat([-1.0, 1.0], _HALF)
        # Flesh is deeper on the palm's side.
        depth = np.where(up < 0, 0.98, 0.86)
        ring = np.column_stack([np.zeros(2 * _HALF), np.sin(angle), up * depth * np.cos(angle)])
        if finger == "T":  # the cloth's halves meet where the thumb is widest as it lies, not as it bends
            ring = Rotation.from_rotvec([-self._thumb_roll, 0.0, 0.0]).apply(ring)
        return middle[:, None] + wide[:, None, None] * np.einsum("rab,kb->rka", turned, ring)

    @cached_property
    def _thumb_roll(self) -> float:
        """From the thumb's own up to that of the palm, about its bone, as it lies on the sheet; radians."""
        turns, _ = self._frames(np.array([_LAID_DEG.get(name, 0.0) for name in ROTATIONS]))
        up = turns["T_MCP"].T @ np.array([0.0, 0.0, 1.0])
        return float(np.arctan2(up[1], up[2]))

    def _swept(
        self, corners: np.ndarray, frames: Rotation, begin: np.ndarray, at: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Middles (N, 3) and frames (N, 3, 3) along the bones: joints are arcs, not corners."""
        middle, turned = np.empty((len(at), 3)), np.empty((len(at), 3, 3))
        heading = np.diff(corners, axis=0) / np.diff(begin)[:, None]
        slerps = [
            Slerp([begin[joint] - _ARC_MM, begin[joint] + _ARC_MM], frames[joint : joint + 2])
            for joint in range(3)
        ]
        for row, place in enumerate(at):
            bone = int(np.clip(np.searchsorted(begin, place, side="right") - 1, 0, 2))
            middle[row] = corners[bone] + (place - begin[bone]) * heading[bone]
            turned[row] = frames[bone + 1].as_matrix()
            for joint in range(3):
                off = place - begin[joint]
                if abs(off) >= _ARC_MM:
                    continue
                turned[row] = slerps[joint](
                    np.clip(place, begin[joint] - _ARC_MM, begin[joint] + _ARC_MM)
                ).as_matrix()
                if joint:
                    share = (off + _ARC_MM) / (2 * _ARC_MM)
                    before = corners[joint] - _ARC_MM * heading[joint - 1]
                    after = corners[joint] + _ARC_MM * heading[joint]
                    middle[row] = (
                        (1 - share) ** 2 * before
                        + 2 * share * (1 - share) * corners[joint]
                        + share**2 * after
                    )
        return middle, turned

    @cached_property
    def _palm_rings(self) -> np.ndarray:
        """Along x: place, thumbward edge, pinkyward edge, half thickness; (_PALM_RINGS, 4) mm."""
        rng = np.random.default_rng([self.seed, 34])
        _, places = self._frames(np.zeros(20))
        length = self.fit.length_mm
        knuckle = 0.5 * (places["I_MCP"][0] + places["R_MCP"][0])
        x = np.linspace(-0.075 * length, knuckle + 0.03 * length, _PALM_RINGS)
        share = np.clip(x / knuckle, 0.0, 1.0)
        thumbward = np.interp(share, [0.0, 0.35, 1.0], [0.135, 0.165, 0.0]) * length
        index, pinky = places["I_MCP"][1], places["P_MCP"][1]
        thumbward = np.where(
            share > 0.35, np.interp(share, [0.35, 1.0], [0.165 * length, index + 0.052 * length]), thumbward
        )
        pinkyward = np.interp(
            share, [0.0, 0.5, 1.0], [-0.135 * length, -0.19 * length, pinky - 0.042 * length]
        )
        thick = np.interp(share, [0.0, 0.4, 1.0], [0.105, 0.092, 0.066]) * length
        grown = np.exp(self.fit.radii * rng.normal(size=2))
        end = np.clip((x - knuckle) / (0.03 * length), 0.0, 1.0)
        return np.column_stack([x, thumbward, pinkyward, thick * grown[0] * np.sqrt(1.0 - 0.75 * end**2)])

    def _palm(self) -> np.ndarray:
        angle = np.radians(np.concatenate([np.linspace(-90.0, 90.0, _HALF)] * 2))
        up = np.repeat([-1.0, 1.0], _HALF)
        found = np.empty((_PALM_RINGS, 2 * _HALF, 3))
        for row, (x, high, low, thick) in enumerate(self._palm_rings):
            across = np.sign(np.sin(angle)) * np.abs(np.sin(angle)) ** 0.8
            found[row] = np.column_stack(
                [
                    np.full(2 * _HALF, x),
                    0.5 * (high + low) + 0.5 * (high - low) * across,
                    up * thick * np.abs(np.cos(angle)) ** 0.6,
                ]
            )
        return found.reshape(-1, 3)

    def _web(self, one: np.ndarray, other: np.ndarray) -> np.ndarray:
        """Between two fingers' tubes: (2 _WEB_ROWS 3, 3), the palm's face first."""
        found = []
        for face in range(2):
            inner = (0 if face == 0 else _HALF) + _HALF // 2
            for row in range(_WEB_ROWS):
                ring = 3 + row
                a, b = one[ring, inner], other[ring, inner]
                thin = 0.5 + 0.4 * row / _WEB_ROWS
                a = one[ring].mean(axis=0) * thin + a * (1 - thin)
                b = other[ring].mean(axis=0) * thin + b * (1 - thin)
                found += [a, 0.5 * (a + b), b]
        return np.array(found)

    def _thumb_web(self, thumb: np.ndarray, palm: np.ndarray) -> np.ndarray:
        """From the thumb's metacarpal to the palm's edge below the index: (2 _WEB_ROWS 3, 3)."""
        found = []
        for face in range(2):
            for row in range(_WEB_ROWS):
                ring, edge = _THUMB_RINGS[row], palm[_PALM_EDGE[row]]
                a = 0.55 * thumb[ring].mean(axis=0) + 0.45 * thumb[ring, face * _HALF + _HALF // 2]
                b = 0.7 * edge[face * _HALF + _HALF - 1] + 0.3 * edge[face * _HALF + _HALF - 4]
                hollow = 0.5 * (a + b) - (0.1 * (row - 1)) * (
                    thumb[ring].mean(axis=0) - thumb[3].mean(axis=0)
                )
                found += [a, hollow, b]
        return np.array(found)

    # Cloth.

    def _finger_cloth(self, number: int, finger: str, rings: np.ndarray, grown: float) -> np.ndarray:
        """(_RINGS, 2 _HALF, 2): places on the sheets of a finger's rings, laid flat (``rings``)."""
        rng = np.random.default_rng([self.seed, 35, number])
        middle = rings.mean(axis=1)
        run = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(middle, axis=0), axis=1))])
        from_tip = (run[-1] - run) * grown * np.exp(0.02 * rng.normal()) + self.fit.short_mm * rng.normal()
        radius = np.linalg.norm(rings - middle[:, None], axis=2).max(axis=1)
        aside = self.fit.seam_mm * rng.normal() / np.maximum(radius, 4.0)
        found = np.empty((_RINGS, 2 * _HALF, 2))
        angle = np.radians(np.linspace(-90.0, 90.0, _HALF))
        for half, side in enumerate(printed_sides()):
            base, tip = _axis(side, number)
            long = float(np.linalg.norm(tip - base))
            share = np.clip(1.0 - from_tip / long, -2.0, 1.0)
            widths = side.half_widths(base, tip, np.maximum(share, 0.02))
            along = (tip - base) / long
            across = np.array([-along[1], along[0]])
            # Seen from outside, the thumb's side is on the palm's right and on the back's left.
            thumbward = across if _is_thumbward(side, across) else -across
            right = widths[:, 1] if thumbward is across else widths[:, 0]
            left = widths[:, 0] if thumbward is across else widths[:, 1]
            turned = angle[None] + (aside[:, None] if half == 0 else -aside[:, None])
            part = turned / (np.pi / 2)
            sideways = np.where(part > 0, part * right[:, None], part * left[:, None])
            found[:, half * _HALF : (half + 1) * _HALF] = (
                base + (share * long)[:, None, None] * along + sideways[..., None] * thumbward
            )
        return found

    def _palm_cloth(
        self, palm: np.ndarray, fingers: Mapping[str, np.ndarray], drawn: Mapping[str, np.ndarray]
    ) -> np.ndarray:
        """Held by the fingers' bases and the hem: thin plates between."""
        found = np.empty((_PALM_RINGS, 2 * _HALF, 2))
        for half, side in enumerate(printed_sides()):
            known, wanted = [], []
            for finger in FINGERS:
                for ring in (4, 6) if finger != "T" else (9, 11):
                    for step in (1, _HALF // 2, _HALF - 2):
                        at = half * _HALF + step
                        known.append(fingers[finger][ring, at, :2])
                        wanted.append(drawn[finger][ring, at])
            for x, high, low, _ in self._palm_rings[[1, 2]]:
                middle = side.hem_mm.mean(axis=0)
                up = x - self._palm_rings[1, 0]
                for share in (0.0, 0.25, 0.5, 0.75, 1.0):
                    known.append(np.array([x, high + share * (low - high)]))
                    place = side.hem_mm[0] + share * (side.hem_mm[1] - side.hem_mm[0])
                    wanted.append(place + np.array([0.0, -up]) + 0.0 * middle)
            fitted = RBFInterpolator(
                np.array(known), np.array(wanted), kernel="thin_plate_spline", smoothing=20.0
            )
            asked = palm[:, half * _HALF : (half + 1) * _HALF, :2].reshape(-1, 2)
            found[:, half * _HALF : (half + 1) * _HALF] = fitted(asked).reshape(_PALM_RINGS, _HALF, 2)
        return found.reshape(-1, 2)

    def _web_cloth(self, one: np.ndarray, other: np.ndarray) -> np.ndarray:
        found = []
        for face in range(2):
            for row in range(_WEB_ROWS):
                # The finger's edge that looks at the other one: ``one`` is nearer the thumb.
                a, b = one[3 + row, face * _HALF], other[3 + row, face * _HALF + _HALF - 1]
                found += [a, 0.5 * (a + b), b]
        return np.array(found)

    def _thumb_web_cloth(self, thumb: np.ndarray, palm: np.ndarray) -> np.ndarray:
        found = []
        for face in range(2):
            for row in range(_WEB_ROWS):
                a, b = thumb[_THUMB_RINGS[row], face * _HALF], palm[_PALM_EDGE[row], face * _HALF + _HALF - 1]
                found += [a, 0.5 * (a + b), b]
        return np.array(found)

    def _wrinkles(self, flat: np.ndarray, back: np.ndarray) -> np.ndarray:
        rng = np.random.default_rng([self.seed, 36])
        found = np.zeros((len(flat), 2))
        for _ in range(8):
            wave = rng.normal(size=3)
            wave *= 2 * np.pi / rng.uniform(15.0, 60.0) / np.linalg.norm(wave)
            found += np.cos(flat @ wave + rng.uniform(0, 6.28) + 2.0 * back)[:, None] * rng.normal(size=2)
        return found * self.fit.wrinkle_mm / max(np.sqrt((found**2).mean()), 1e-9)


_PALM_RINGS, _WEB_ROWS = 14, 5
_LAID_DEG = {"T_TMC": 20.0, "TI_ABD": 55.0, "T_VIR": 30.0, "IM_ABD": 22.0, "MR_ABD": 22.0, "RP_ABD": 22.0}
"""As the sheets lie: fingers apart."""
_THUMB_RINGS, _PALM_EDGE = (3, 5, 7, 9, 10), (4, 5, 7, 9, 10)
"""Between which the thumb's web is stretched."""


def _axis(side: PrintedSide, number: int) -> tuple[np.ndarray, np.ndarray]:
    """A finger's base and tip on the sheet; the base is between its crotches, or level with the one."""
    tip = side.tips_mm[number]
    beside = [side.crotches_mm[each] for each in (number - 1, number) if 0 <= each < 4]
    nearer = [
        each
        for each in beside
        if np.linalg.norm(each - tip) < 1.5 * min(np.linalg.norm(each - tip) for each in beside)
    ]
    if number not in (0, 1, 4) and len(nearer) == 2:
        return np.mean(nearer, axis=0), tip
    # One crotch: along the seam over the tip to the other side, as far from the tip.
    crotch = min(beside, key=lambda each: float(np.linalg.norm(each - tip)))
    seam = _seam(side)
    at, start = (int(np.argmin(np.linalg.norm(seam - place, axis=1))) for place in (tip, crotch))
    onwards = 1 if (at - start) % len(seam) < len(seam) // 2 else -1
    places = np.roll(seam[::onwards], -(at if onwards > 0 else len(seam) - 1 - at), axis=0)
    other = places[np.argmax(np.linalg.norm(places - tip, axis=1) >= np.linalg.norm(crotch - tip))]
    return 0.5 * (crotch + other), tip


@cache
def _seam(side: PrintedSide) -> np.ndarray:
    outline = max(find_contours((side.colours > 0).astype(float), 0.5), key=len)[:, ::-1]
    return outline / _PIXELS_PER_MM + side.corner_mm


def _is_thumbward(side: PrintedSide, across: np.ndarray) -> bool:
    return bool(across @ (side.hem_mm[0] - side.hem_mm[1]) > 0)


def family(count: int, first_seed: int) -> list[WornGlove]:
    """Hands of different people in gloves that fit each a little differently."""
    rng = np.random.default_rng([first_seed, 37])
    return [
        WornGlove(
            first_seed + number,
            replace(Fit(), length_mm=float(np.clip(rng.normal(188.0, 9.0), 165.0, 210.0)),
                    seam_mm=float(rng.uniform(1.0, 7.0)), short_mm=float(rng.uniform(0.0, 5.0)),
                    wrinkle_mm=float(rng.uniform(0.3, 2.5)), tilt_deg=float(rng.uniform(1.0, 6.0))),
        )
        for number in range(count)
    ]  # fmt: skip
