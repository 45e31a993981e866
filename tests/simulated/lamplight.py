"""Pictures of hands in the colour glove as rooms light them: lamps with cast shadows, gloss, JPEG.

What the tracker was set on (``colour_glove.photograph``) has neither shadows nor gloss. One scene can be
taken at any resolution: it is drawn finely, and each camera averages what its pixels cover.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from glovecal_models.colour_glove.camera_model import Camera
from glovecal_models.colour_glove.database import palm_centre
from glovecal_models.colour_glove.hand_state import HandState
from glovecal_models.colour_glove.pattern import PRINTED_SRGB, Pattern, encoded_light, linear_light
from glovecal_models.colour_glove.rasterise import rasterise
from glovecal_models.colour_glove.skin import HandSkin, posed

ROOMS = ("plain", "gradient", "striped", "cluttered", "dark")
LIGHTS = ("soft", "one lamp", "two lamps", "warm and cold")
_SHADOW_PX, _SHADOW_BIAS_MM = 400, 4.0
_ENCODED = encoded_light(np.linspace(0.0, 1.0, 4096))


@dataclass(frozen=True)
class Lamp:
    place_mm: tuple[float, float, float]
    colour: tuple[float, float, float]


@dataclass(frozen=True)
class Scene:
    """What is before the camera. The same scene gives the same light at any resolution."""

    seed: int
    light: str = "soft"
    room: str = "plain"
    arm: bool = True
    gloss: float = 0.0
    exposure: float = 1.0
    noise: float = 1.0
    blur_px: float = 0.6
    jpeg: int | None = None

    def lamps(self) -> tuple[list[Lamp], float]:
        """Lamps, and how much light comes from everywhere."""
        rng = np.random.default_rng([self.seed, 1])

        def lamp(strength: float, tint: Sequence[float] = (1.0, 1.0, 1.0)) -> Lamp:
            side = rng.choice([-1.0, 1.0])
            place = (side * rng.uniform(200, 900), -rng.uniform(200, 900), -rng.uniform(100, 500))
            return Lamp(place, tuple(strength * value for value in tint))  # type: ignore[arg-type]

        if self.light == "soft":
            return [lamp(0.25)], 0.75
        if self.light == "one lamp":
            return [lamp(0.85)], 0.25
        if self.light == "two lamps":
            return [lamp(0.6), lamp(0.4)], 0.25
        return [lamp(0.5, (1.0, 0.88, 0.72)), lamp(0.35, (0.85, 0.95, 1.1))], 0.3


def lit_picture(
    scene: Scene, skin: HandSkin, pattern: Pattern, camera: Camera, states: Sequence[HandState]
) -> tuple[np.ndarray, np.ndarray]:
    """Linear light (H, W, 3) float32 red, green, blue, and true labels (H, W) uint8.

    Several ``states``: as many hands in gloves of this pattern."""
    triangles, colours = [], []
    vertices, glove = [], []
    start = 0
    rng = np.random.default_rng([scene.seed, 2])
    flesh = linear_light(np.array([[215, 165, 135]], np.uint8))[0] * rng.uniform(0.3, 1.1)
    for state in states:
        placed = posed(skin, state)
        vertices.append(placed)
        triangles.append(skin.triangles + start)
        colours.append(linear_light(PRINTED_SRGB)[pattern.colour - 1])
        glove.append(pattern.colour)
        start += len(placed)
        if scene.arm:
            arm, faces = _arm(state)
            vertices.append(arm)
            triangles.append(faces + start)
            colours.append(np.tile(flesh, (len(faces), 1)))
            glove.append(np.zeros(len(faces), np.uint8))
            start += len(arm)
    mesh, faces = np.concatenate(vertices), np.concatenate(triangles).astype(np.int32)
    paint, code = np.concatenate(colours), np.append(np.concatenate(glove), 0).astype(np.uint8)
    shown = rasterise(mesh, faces, camera)
    light = room(scene, camera.width, camera.height)
    v, u = np.nonzero(shown.triangle >= 0)
    which = shown.triangle[v, u]
    directions = camera.undistort(np.column_stack([u, v]).astype(float))
    places = np.column_stack([directions, np.ones(len(u))]) * shown.depth_mm[v, u][:, None]
    normals = _normals(mesh, faces)[faces[which]].mean(axis=1)
    towards = -places / np.linalg.norm(places, axis=1, keepdims=True)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True) + 1e-9
    normals *= np.sign((normals * towards).sum(axis=1, keepdims=True) + 1e-9)
    lamps, ambient = scene.lamps()
    diffuse = np.full((len(u), 3), ambient) * (0.8 - 0.2 * normals[:, 1:2])
    shine = np.zeros((len(u), 3))
    for lamp in lamps:
        way = np.array(lamp.place_mm) - places
        way /= np.linalg.norm(way, axis=1, keepdims=True)
        lit = np.clip((normals * way).sum(axis=1), 0.0, 1.0) * ~_in_shadow(mesh, faces, lamp, places)
        diffuse += 1.25 * lit[:, None] * lamp.colour
        half = way + towards
        half /= np.linalg.norm(half, axis=1, keepdims=True)
        shine += (np.clip((normals * half).sum(axis=1), 0, 1) ** 25 * (lit > 0))[:, None] * lamp.colour
    light[v, u] = paint[which] * diffuse + scene.gloss * shine
    return light, code[shown.triangle]


def taken(scene: Scene, light: np.ndarray, width: int, number: int = 0) -> np.ndarray:
    """(H, W, 3) uint8 blue, green, red, ``width`` pixels across, from linear light of at least that width."""
    rng = np.random.default_rng([scene.seed, 3, number, width])
    height = round(light.shape[0] * width / light.shape[1])
    picture = light
    if (height, width) != light.shape[:2]:
        picture = cv2.resize(light, (width, height), interpolation=cv2.INTER_AREA)
    if scene.blur_px:
        picture = cv2.GaussianBlur(picture, (0, 0), scene.blur_px)
    picture = picture * np.float32(scene.exposure)
    if scene.noise:
        spread = np.sqrt(np.maximum(picture, 0) * 4e-4 + 4e-6) * np.float32(scene.noise)
        picture = picture + spread * rng.standard_normal(picture.shape, dtype=np.float32)
    code = np.clip(picture * 4095 + 0.5, 0, 4095).astype(np.uint16)
    found = np.ascontiguousarray(_ENCODED[code][..., ::-1])
    if scene.jpeg is not None:
        _, packed = cv2.imencode(".jpg", found, [cv2.IMWRITE_JPEG_QUALITY, scene.jpeg])
        found = np.asarray(cv2.imdecode(packed, cv2.IMREAD_COLOR))
    return found


def room(scene: Scene, width: int, height: int) -> np.ndarray:
    """Linear light (H, W, 3) float32; places are shares of the picture, so any size shows the same."""
    rng = np.random.default_rng([scene.seed, 4])
    level = rng.uniform(0.02, 0.05) if scene.room == "dark" else rng.uniform(0.2, 0.6)
    wall = level * (1.0 + rng.normal(0, 0.06, 3))
    found = np.tile(wall.astype(np.float32), (height, width, 1))
    across = np.linspace(0, 1, width, dtype=np.float32)[None, :, None]
    down = np.linspace(0, 1, height, dtype=np.float32)[:, None, None]
    if scene.room in ("gradient", "striped", "cluttered"):
        a, b = rng.uniform(-0.4, 0.4, 2)
        found *= 1 + a * (across - 0.5) + b * (down - 0.5)
    if scene.room == "striped":  # boards of wood
        boards = np.floor(down * rng.integers(5, 14))
        tint = np.array([1.0, 0.72, 0.45], np.float32)
        found *= tint * (1 + 0.15 * np.sin(7.1 * boards) + 0.05 * np.sin(60 * across + 3 * boards))
    if scene.room == "cluttered":
        for _ in range(16):
            colour = linear_light(rng.integers(20, 235, (1, 3)).astype(np.uint8))[0]
            cu, cv, size = rng.uniform(0, width), rng.uniform(0, height), rng.uniform(0.01, 0.1) * width
            if rng.random() < 0.5:
                cv2.circle(found, (int(cu), int(cv)), max(1, int(size)), colour.tolist(), -1)
            else:
                box = cv2.boxPoints(((cu, cv), (2 * size, size), rng.uniform(0, 180)))
                cv2.fillConvexPoly(found, box.astype(np.int32), colour.tolist())
    return found


def turned(state: HandState, quarter_turns: int) -> HandState:
    """As a camera sees it that is turned by quarters of a circle about its axis."""
    angle = np.pi / 2 * quarter_turns
    turn = np.array(
        [[np.cos(angle), -np.sin(angle), 0.0], [np.sin(angle), np.cos(angle), 0.0], [0.0, 0.0, 1.0]]
    )
    return replace(state, rotation=turn @ state.rotation, position_mm=turn @ state.position_mm)


def at(skin: HandSkin, state: HandState, across: float, down: float, depth: float) -> HandState:
    """The same hand with its palm's centre there, mm."""
    there = np.array([across, down, depth]) - state.rotation @ palm_centre(skin)
    return replace(state, position_mm=there)


def _arm(state: HandState) -> tuple[np.ndarray, np.ndarray]:
    rings, around = 6, 20
    along = np.linspace(-25.0, -260.0, rings)
    angle = np.linspace(0, 2 * np.pi, around, endpoint=False)
    ring = np.column_stack([np.zeros(around), 1.15 * np.cos(angle), 0.8 * np.sin(angle)])
    places = np.concatenate([ring * (23 + 18 * i / rings) + (x, 0.0, 0.0) for i, x in enumerate(along)])
    faces = []
    for ring_number in range(rings - 1):
        for i in range(around):
            a, b = ring_number * around + i, ring_number * around + (i + 1) % around
            faces += [(a, a + around, b), (b, a + around, b + around)]
    return places @ state.rotation.T + state.position_mm, np.array(faces, np.int32)


def _normals(vertices: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    a, b, c = (vertices[triangles[:, corner]] for corner in range(3))
    across, found = np.cross(b - a, c - a), np.zeros_like(vertices)
    for corner in range(3):
        np.add.at(found, triangles[:, corner], across)
    return found / (np.linalg.norm(found, axis=1, keepdims=True) + 1e-9)


def _in_shadow(mesh: np.ndarray, faces: np.ndarray, lamp: Lamp, places: np.ndarray) -> np.ndarray:
    """(N,) whether something of the mesh is between the lamp and each place."""
    middle = mesh.mean(axis=0)
    z = middle - np.array(lamp.place_mm)
    far = np.linalg.norm(z)
    z /= far
    x = np.cross([0.0, 1.0, 0.0], z)
    x /= np.linalg.norm(x)
    turn = np.array([x, np.cross(z, x), z])
    reach = np.linalg.norm(mesh - middle, axis=1).max()
    focal = 0.5 * _SHADOW_PX * far / reach * 0.9
    half = (_SHADOW_PX - 1) / 2
    shift = -turn @ np.array(lamp.place_mm)
    view = Camera(
        _SHADOW_PX, _SHADOW_PX, (focal, focal), (half, half),
        rotation=tuple(map(tuple, turn.tolist())), translation_mm=tuple(shift.tolist()),
    )  # fmt: skip
    depth = rasterise(mesh, faces, view).depth_mm
    pixels = np.clip(np.nan_to_num(np.round(view.project(places))), 0, _SHADOW_PX - 1).astype(int)
    return view.from_outside(places)[:, 2] > depth[pixels[:, 1], pixels[:, 0]] + _SHADOW_BIAS_MM
