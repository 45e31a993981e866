"""Photographs of a hand in the colour glove, drawn: light, cloth, a lens that blurs, a sensor with noise.

Light is added up linearly: the printed colour times the shading of a lamp and of the room, cloth with a weave
and folds, an arm behind the wrist, a background; several moments of one exposure; then the lens's blur, the
camera's gains (a colour cast), photon and read noise, and eight bits of sRGB. A second lamp may have another
colour, the print may shine, and fingers cast shadows. Rolling shutter and JPEG are not drawn.

A moving hand: natural configurations one after another, the palm turning and drifting before a camera.

For what has to be learned or measured on sequences: how far a hand moves from one picture to the next, how
errors last. Generated, as the poses are.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np

from glovecal_models.colour_glove.camera_model import Camera
from glovecal_models.colour_glove.database import orientations, palm_centre
from glovecal_models.colour_glove.hand_state import HandState
from glovecal_models.colour_glove.pattern import PRINTED_SRGB, Pattern, encoded_light, linear_light
from glovecal_models.colour_glove.pose_set import generated_poses
from glovecal_models.colour_glove.rasterise import rasterise, z_buffer
from glovecal_models.colour_glove.skin import HandSkin, posed
from glovecal_models.errors import BadInput

HOLD_S, CHANGE_S = (0.1, 0.6), (0.35, 0.9)
"""How long a configuration is held, how long the way to the next takes."""
TURN_S, WANDER_S = (1.0, 2.5), (1.0, 2.5)
NEAREST_MM, FARTHEST_MM = 350.0, 600.0
ASIDE = (0.25, 0.18)
"""Of the distance: how far the palm goes from the camera's axis, across and down."""
CONE_DEG = 60.0
ARMS = ("skin", "sleeve", "none")
MOMENTS = 5
"""Of an exposure during which the hand moves."""
EXAMPLES = 24
"""The paper labelled 8 by hand (section 5.1), all in one light; these are of many."""
_LAMP_POINTS, _LAMP_MM, _LAMP_AWAY_MM = 256, 340.0, 20_000.0
"""What a lamp sees of the hand, to draw shadows: points along a side, their reach, the lamp's distance."""
_IN_SHADOW_MM = 5.0
"""Behind what the lamp sees; less is the same surface."""
_SHARPNESS = 20.0
"""Of a highlight: Blinn's exponent for the sheen of iron-on film."""
_AROUND, _ALONG = 24, 8
_ARM_MM = (-25.0, -300.0)
_ARM_RADII_MM = {"skin": (22.0, 40.0), "sleeve": (25.0, 40.0)}
"""A wrist is inside the glove's cuff, a sleeve may be over it."""


def hand_motion(
    skin: HandSkin, seconds: float, rate_hz: float = 30.0, *, seed: int, cone_deg: float = CONE_DEG
) -> list[HandState]:
    """States at 0, 1 / rate, ... before ``seconds``. Raises BadInput unless length and rate are above 0."""
    if not (seconds > 0 and rate_hz > 0):
        raise BadInput(f"a motion of {seconds} s at {rate_hz} Hz; both must be above 0")
    from scipy.spatial.transform import Rotation, Slerp

    rng = np.random.default_rng([seed, 14])
    times = np.arange(0.0, seconds, 1.0 / rate_hz)
    angles = _held_and_changed(rng, times, generated_poses(int(seconds / 0.3) + 4, seed=seed))
    stations = _stations(rng, seconds, TURN_S)
    turns = Rotation.from_matrix(orientations(len(stations), cone_deg, rng))
    # A turn of half a circle within a second is more than an arm does.
    turns = Rotation.concatenate([turns[0], *_limited(turns)])
    rotations = Slerp(stations, turns)(_eased(times, stations)).as_matrix()
    stops = _stations(rng, seconds, WANDER_S)
    depth = rng.uniform(NEAREST_MM, FARTHEST_MM, len(stops))
    aside = rng.uniform(-1.0, 1.0, (len(stops), 2)) * ASIDE * depth[:, None]
    way = _eased(times, stops)
    where = np.column_stack([np.interp(way, stops, axis) for axis in (*aside.T, depth)])
    centre = palm_centre(skin)
    return [
        HandState(bend, turn, place - turn @ centre)
        for bend, turn, place in zip(angles, rotations, where, strict=True)
    ]


def _limited(turns):  # type: ignore[no-untyped-def]
    """Each next orientation at most 60 degrees from the one before."""
    found, last = [], turns[0]
    for turn in turns[1:]:
        step = turn * last.inv()
        angle = step.magnitude()
        share = min(1.0, np.radians(60.0) / max(angle, 1e-9))
        last = type(step).from_rotvec(share * step.as_rotvec()) * last
        found.append(last)
    return found


def _stations(rng: np.random.Generator, seconds: float, apart_s: tuple[float, float]) -> np.ndarray:
    found = [0.0]
    while found[-1] <= seconds:
        found.append(found[-1] + rng.uniform(*apart_s))
    return np.array(found)


def _eased(times: np.ndarray, stations: np.ndarray) -> np.ndarray:
    """The same times, slow at each station."""
    segment = np.clip(np.searchsorted(stations, times, side="right") - 1, 0, len(stations) - 2)
    low, high = stations[segment], stations[segment + 1]
    share = (times - low) / (high - low)
    return low + (high - low) * share * share * (3.0 - 2.0 * share)


def _held_and_changed(rng: np.random.Generator, times: np.ndarray, poses: np.ndarray) -> np.ndarray:
    """(N, 20): from pose to pose by minimum jerk, each held for a while."""
    found = np.empty((len(times), poses.shape[1]))
    begin, index = 0.0, 0
    while True:
        hold, change = rng.uniform(*HOLD_S), rng.uniform(*CHANGE_S)
        here, there = poses[index % len(poses)], poses[(index + 1) % len(poses)]
        share = np.clip((times - begin - hold) / change, 0.0, 1.0)
        share = share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
        now = times >= begin
        found[now] = here + share[now, None] * (there - here)
        begin += hold + change
        index += 1
        if begin > times[-1]:
            return found


@dataclass(frozen=True)
class Photography:
    """How pictures are taken. Raises BadInput for what no camera or room does."""

    gains: tuple[float, float, float] = (1.0, 1.0, 1.0)
    """Of red, green and blue: the cast of light that the camera was not balanced for."""
    exposure: float = 1.0
    shading: float = 0.6
    """Share of the light that comes from lamps; the rest comes from everywhere."""
    second: float = 0.0
    """Share of the lamps' light that is a second one's, elsewhere in the room."""
    tint: float = 0.0
    """How much warmer one lamp and cooler the other is, relative in red and blue."""
    gloss: float = 0.0
    """Of the print: a highlight's strength over the lamp's."""
    shadows: bool = False
    """Whether hand and arm take light away from themselves."""
    weave: float = 0.05
    """Standard deviation of the cloth's brightness from pixel to pixel, relative."""
    folds: float = 0.3
    """How far folds turn the cloth, root mean square, radians."""
    blur_px: float = 0.8
    """Standard deviation of the lens's blur."""
    noise: float = 1.0
    """1: a webcam indoors, about 4 of 255 in the middle of the range; 0: none."""
    clutter: bool = True
    face: bool = True
    arm: str = "skin"

    def __post_init__(self) -> None:
        amounts = (
            *self.gains, self.exposure, self.shading, self.second, self.tint, self.gloss, self.weave,
            self.folds, self.blur_px, self.noise,
        )  # fmt: skip
        if not (np.isfinite(amounts).all() and min(amounts) >= 0 and min(*self.gains, self.exposure) > 0):
            raise BadInput(f"a photograph needs gains and exposure above 0, and no negative amount: {self}")
        if max(self.shading, self.second, self.tint) > 1 or self.arm not in ARMS:
            raise BadInput(
                f"shading {self.shading}, second {self.second}, tint {self.tint} (0 to 1), arm {self.arm!r} "
                f"(one of {', '.join(ARMS)}): impossible"
            )


def some_light(
    rng: np.random.Generator, arm: str, gains: tuple[float, float, float] = (1.0, 1.0, 1.0)
) -> Photography:
    """As rooms have it: from a bright one to two lamps of different colour with shadows and gloss."""
    return Photography(
        gains=gains,
        exposure=float(rng.uniform(0.75, 1.15)),
        shading=float(rng.uniform(0.3, 0.85)),
        second=float(rng.choice([0.0, rng.uniform(0.2, 0.5)])),
        tint=float(rng.uniform(0.0, 0.25)),
        gloss=float(rng.choice([0.0, rng.uniform(0.0, 0.3)])),
        shadows=bool(rng.random() < 0.7),
        arm=arm,
    )


@dataclass(frozen=True, eq=False)
class Photograph:
    picture: np.ndarray
    """(H, W, 3) uint8 blue, green, red."""
    labels: np.ndarray
    """(H, W) uint8: the colour truly there in the middle of the exposure."""


@dataclass(frozen=True, eq=False)
class Photographer:
    """One hand, camera, room and light. The same arguments and calls give the same pictures."""

    skin: HandSkin
    pattern: Pattern
    camera: Camera
    photography: Photography
    seed: int
    inks: np.ndarray | None = None
    """(10, 3) linear light of the glove's colours, red, green, blue, as a card's picture tells it; None: as
    printed."""

    def photograph(self, state: HandState, until: HandState | None = None, *, number: int = 0) -> Photograph:
        """The picture of ``state``; with ``until`` the exposure goes on while the hand moves there.

        ``number``: of the picture, for its own noise.
        """
        rng = np.random.default_rng([self.seed, 1, number])
        states = [state]
        if until is not None:
            step = until.step_from(state)
            states = [state.moved(share * step) for share in np.linspace(0.0, 1.0, MOMENTS)]
        drawn = [self._light(moment) for moment in states]
        light = np.mean([moment for moment, _ in drawn], axis=0) if len(drawn) > 1 else drawn[0][0]
        look = self.photography
        if look.blur_px:
            light = cv2.GaussianBlur(light, (0, 0), look.blur_px)
        light = light * (np.float32(look.exposure) * np.array(look.gains, np.float32))
        if look.noise:
            spread = np.sqrt(np.maximum(light, 0.0) * 4e-4 + 4e-6) * np.float32(look.noise)
            light = light + spread * rng.standard_normal(light.shape, dtype=np.float32)
        picture = np.ascontiguousarray(_ENCODED[_codes(light)][..., ::-1])
        return Photograph(picture, drawn[len(drawn) // 2][1])

    @cached_property
    def _room(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Linear background (H, W, 3), directions to both lamps (2, 3), weave (H, W), folds of the skin
        (V, 3)."""
        rng, look = np.random.default_rng([self.seed, 0]), self.photography
        height, width = self.camera.height, self.camera.width
        behind = background(width, height, rng, clutter=look.clutter, face=look.face)
        lamp = np.array([rng.uniform(-0.8, 0.8), rng.uniform(-1.0, -0.2), -1.0])
        weave = 1.0 + look.weave * rng.standard_normal((height, width), dtype=np.float32)
        # Waves through the cloth, a few centimetres long: what turns the normals is their gradient.
        places, folds = self.skin.vertices_mm, np.zeros_like(self.skin.vertices_mm)
        for _ in range(6):
            direction = rng.normal(size=3)
            direction *= 2 * np.pi / rng.uniform(12.0, 45.0) / np.linalg.norm(direction)
            wave = np.cos(places @ direction + rng.uniform(0, 2 * np.pi))
            folds += wave[:, None] * direction / np.linalg.norm(direction)
        folds *= look.folds / max(np.sqrt((folds**2).sum(axis=1).mean()), 1e-9)
        second = np.array([rng.uniform(-1.0, 1.0), rng.uniform(-1.0, 0.3), rng.uniform(-1.2, -0.5)])
        lamps = np.stack([lamp / np.linalg.norm(lamp), second / np.linalg.norm(second)])
        return linear_light(behind), lamps, weave, folds

    @property
    def _inks(self) -> np.ndarray:
        return linear_light(PRINTED_SRGB) if self.inks is None else self.inks

    @cached_property
    def _surface(self) -> tuple[np.ndarray, np.ndarray]:
        """Triangles of hand and arm, and their linear colours."""
        rng = np.random.default_rng([self.seed, 2])
        sleeve = rng.uniform(30, 200, 3) if self.photography.arm == "sleeve" else None
        arm = sleeve if sleeve is not None else np.array(SKIN_SRGB[rng.integers(len(SKIN_SRGB))])
        triangles, colours = self.skin.triangles, self._inks[self.pattern.colour - 1]
        if self.photography.arm != "none":
            triangles = np.concatenate([triangles, _arm_triangles() + len(self.skin.vertices_mm)])
            extra = len(triangles) - len(colours)
            colours = np.concatenate([colours, np.tile(linear_light(arm), (extra, 1))])
        return np.ascontiguousarray(triangles, dtype=np.int32), colours

    def _light(self, state: HandState) -> tuple[np.ndarray, np.ndarray]:
        """Linear light (H, W, 3) float32 of one moment, and its labels."""
        behind, lamps, weave, folds = self._room
        triangles, colours = self._surface
        placed = posed(self.skin, state)
        if self.photography.arm != "none":
            arm = _arm_vertices(self.photography.arm) @ state.rotation.T + state.position_mm
            placed = np.concatenate([placed, arm])
        shown = rasterise(placed, triangles, self.camera).triangle
        v, u = np.nonzero(shown >= 0)
        which = shown[v, u]
        normals = _vertex_normals(placed, triangles)
        normals[: len(folds)] += folds @ state.rotation.T
        facing = normals[triangles[which]].mean(axis=1)
        facing /= np.linalg.norm(facing, axis=1, keepdims=True) + 1e-9
        look = self.photography
        light = (1.0 - look.shading) * (0.75 - 0.25 * facing[:, 1:2]) * np.ones(3)
        shine = np.zeros((len(which), 3))
        where = placed[triangles[which]].mean(axis=1)
        towards = -where / np.linalg.norm(where, axis=1, keepdims=True)
        warm = look.tint * np.array([1.0, 0.0, -1.0])
        for lamp, share, colour in zip(
            lamps, (1.0 - look.second, look.second), (1.0 + warm, 1.0 - warm), strict=True
        ):
            if not share:
                continue
            reaching = _reaching(placed, triangles, which, lamp) if look.shadows else np.ones(len(which))
            lit = 1.2 * np.clip(0.5 + 0.5 * (facing @ lamp), 0.0, 1.0) ** 1.5  # light wraps around cloth
            strength = look.shading * share * reaching[:, None] * colour
            light += lit[:, None] * strength
            half = towards + lamp
            half /= np.linalg.norm(half, axis=1, keepdims=True) + 1e-9
            shine += np.clip((facing * half).sum(axis=1), 0.0, 1.0)[:, None] ** _SHARPNESS * strength
        shown_light = behind.copy()
        shown_light[v, u] = colours[which] * light * weave[v, u][:, None]
        if look.gloss:
            shown_light[v, u] += look.gloss * shine * (which < len(self.pattern.colour))[:, None]
        glove = np.append(self.pattern.colour, np.zeros(len(triangles) - len(self.pattern.colour) + 1))
        return shown_light, glove.astype(np.uint8)[shown]


def _reaching(placed: np.ndarray, triangles: np.ndarray, which: np.ndarray, lamp: np.ndarray) -> np.ndarray:
    """(N,) 0 to 1: how much of a far lamp's light reaches triangles ``which``; edges of shadows are soft."""
    up = np.array([0.0, 1.0, 0.0]) if abs(lamp[1]) < 0.9 else np.array([1.0, 0.0, 0.0])
    right = np.cross(up, lamp)
    right /= np.linalg.norm(right)
    frame = np.stack([right, np.cross(lamp, right), -lamp])
    asked = placed[triangles[which]].mean(axis=1) @ frame.T
    middle = np.append(np.median(asked[:, :2], axis=0), asked[:, 2].mean() - _LAMP_AWAY_MM)
    seen, asked = placed @ frame.T - middle, asked - middle
    scale = _LAMP_POINTS / _LAMP_MM
    points = seen[:, :2] * scale + _LAMP_POINTS / 2
    _, nearest = z_buffer(points, seen[:, 2], triangles, _LAMP_POINTS, _LAMP_POINTS)
    is_lit = np.zeros(len(which))
    places = np.rint(asked[:, :2] * scale + _LAMP_POINTS / 2).astype(int)
    for step in ((0, 0), (1, 0), (-1, 0), (0, 1), (0, -1)):
        u, v = np.clip(places + step, 0, _LAMP_POINTS - 1).T
        is_lit += asked[:, 2] <= nearest[v, u] + _IN_SHADOW_MM
    return is_lit / 5.0


_ENCODED = encoded_light(np.linspace(0.0, 1.0, 4096))
"""By 4095 times the light."""


def _codes(light: np.ndarray) -> np.ndarray:
    return np.clip(light * 4095.0 + 0.5, 0.0, 4095.0).astype(np.uint16)


def _vertex_normals(vertices: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    a, b, c = (vertices[triangles[:, corner]] for corner in range(3))
    across = np.cross(b - a, c - a)
    found = np.empty_like(vertices)
    for axis in range(3):
        found[:, axis] = np.bincount(
            triangles.ravel(), np.repeat(across[:, axis], 3), minlength=len(vertices)
        )
    return found / (np.linalg.norm(found, axis=1, keepdims=True) + 1e-9)


def _arm_vertices(arm: str) -> np.ndarray:
    """(R A, 3) in the palm's frame: rings from behind the wrist to the elbow's side."""
    along = np.linspace(*_ARM_MM, _ALONG)
    radii = np.linspace(*_ARM_RADII_MM[arm], _ALONG)
    turn = np.linspace(0.0, 2 * np.pi, _AROUND, endpoint=False)
    ring = np.column_stack([np.zeros(_AROUND), 1.15 * np.cos(turn), 0.85 * np.sin(turn)])
    return np.concatenate([ring * radius + (x, 0.0, 0.0) for x, radius in zip(along, radii, strict=True)])


def _arm_triangles() -> np.ndarray:
    found = []
    for ring in range(_ALONG - 1):
        for index in range(_AROUND):
            here, beside = ring * _AROUND + index, ring * _AROUND + (index + 1) % _AROUND
            found += [(here, here + _AROUND, beside), (beside, here + _AROUND, beside + _AROUND)]
    return np.array(found, dtype=np.int32)


def labelled_photographs(
    skin: HandSkin,
    pattern: Pattern,
    camera: Camera,
    *,
    count: int = EXAMPLES,
    seed: int = 1,
    inks: np.ndarray | None = None,
    gains: tuple[float, float, float] = (1.0, 1.0, 1.0),
) -> list[Photograph]:
    """To learn the glove's colours from, where nobody has labelled real ones.

    Each is of another pose, in another room and light (``some_light``), with another arm; all seen with
    ``gains`` (red, green, blue), and with ``inks`` (10, 3) in place of the printed colours.
    """
    rng = np.random.default_rng([seed, 8])
    found = []
    for index, state in enumerate(hand_motion(skin, 2.0 * count, 0.5, seed=seed)[:count]):
        look, room = some_light(rng, ("skin", "sleeve")[index % 2], gains), int(rng.integers(2**31))
        found.append(Photographer(skin, pattern, camera, look, room, inks).photograph(state))
    return found


# What is behind the hand: a wall, a desk, things in all colours, and a face.


SKIN_SRGB = ((236, 188, 160), (205, 150, 120), (165, 110, 80), (110, 72, 52))
"""Of four people."""
_THINGS = 14
_SATURATED = 0.3
"""Share of the things whose colour is as strong as the glove's."""


def background(width: int, height: int, rng: np.random.Generator, *, clutter: bool, face: bool) -> np.ndarray:
    """(H, W, 3) uint8 red, green, blue."""
    wall, desk = (rng.uniform(90, 210) + rng.normal(0, 8, 3) for _ in range(2))
    edge = rng.uniform(0.45, 0.75) * height
    rows = np.arange(height)[:, None, None]
    across = np.linspace(rng.uniform(0.75, 1.0), rng.uniform(0.75, 1.0), width)[None, :, None]
    picture = np.clip(np.where(rows < edge, wall, desk) * across, 0, 255).astype(np.uint8).copy()
    if face:
        _draw_face(picture, rng)
    if clutter:
        for _ in range(_THINGS):
            _draw_thing(picture, rng)
    return picture


def _draw_thing(picture: np.ndarray, rng: np.random.Generator) -> None:
    height, width = picture.shape[:2]
    if rng.random() < _SATURATED:
        hue = np.array([[[rng.integers(0, 180), rng.integers(120, 230), rng.integers(80, 240)]]], np.uint8)
        colour = cv2.cvtColor(hue, cv2.COLOR_HSV2RGB)[0, 0]
    else:
        colour = np.clip(rng.uniform(40, 220) + rng.normal(0, 25, 3), 0, 255)
    place = (int(rng.integers(0, width)), int(rng.integers(0, height)))
    reach = float(width) * 0.02 + rng.exponential(0.03 * width)
    size = (int(reach), int(reach * rng.uniform(0.3, 1.0)))
    paint = tuple(int(value) for value in colour)
    if rng.random() < 0.5:
        cv2.ellipse(picture, place, size, rng.uniform(0, 180), 0, 360, paint, -1, cv2.LINE_AA)
    else:
        corners = cv2.boxPoints((place, (2 * size[0], 2 * size[1]), rng.uniform(0, 180)))
        cv2.fillConvexPoly(picture, corners.astype(np.int32), paint, cv2.LINE_AA)


def _draw_face(picture: np.ndarray, rng: np.random.Generator) -> None:
    """Skin, hair, eyes and mouth, mostly beside the middle."""
    height, width = picture.shape[:2]
    skin = SKIN_SRGB[rng.integers(len(SKIN_SRGB))]
    hair = tuple(int(value) for value in rng.uniform(15, 90) * np.array([1.0, 0.8, 0.6]))
    u = int(width * (rng.uniform(0.05, 0.3) if rng.random() < 0.5 else rng.uniform(0.7, 0.95)))
    v, tall = int(height * rng.uniform(0.2, 0.4)), int(height * rng.uniform(0.14, 0.24))
    broad = int(0.75 * tall)
    cv2.ellipse(picture, (u, v - tall // 3), (int(1.15 * broad), tall), 0, 0, 360, hair, -1, cv2.LINE_AA)
    cv2.ellipse(picture, (u, v), (broad, tall), 0, 0, 360, skin, -1, cv2.LINE_AA)
    for side in (-1, 1):
        eye = (u + side * int(0.4 * broad), v - tall // 6)
        cv2.ellipse(picture, eye, (broad // 6, tall // 14), 0, 0, 360, (245, 245, 245), -1, cv2.LINE_AA)
        cv2.circle(picture, eye, max(1, tall // 18), (40, 30, 25), -1, cv2.LINE_AA)
    mouth = (u, v + int(0.5 * tall))
    cv2.ellipse(picture, mouth, (broad // 3, tall // 12), 0, 0, 360, (170, 80, 85), -1, cv2.LINE_AA)
