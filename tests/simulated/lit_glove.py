"""Pictures of a worn glove (``worn_glove``) in rooms with two coloured lamps: shadows, gloss, skin, a lens.

For trying the tracker on: nothing of how it draws pictures itself is used. Triangles are filled with what
lies between their corners (place on the cloth, direction of the surface), twice as fine as the picture; each
lamp has a map of what it sees, so that fingers shade the palm; iron-on film shines. One moment's light, drawn
finely, is the same scene for sensors of any size (``averaged``).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import cv2
import numba
import numpy as np
from scipy.ndimage import gaussian_filter, zoom
from scipy.spatial.transform import Rotation
from worn_glove import ROTATIONS, WornGlove

from glovecal_models.colour_glove.camera_model import Camera
from glovecal_models.colour_glove.pattern import PRINTED_SRGB

_FINER = 2
_WEAVE_ACROSS = 1280
"""Threads of the cloth that the picture's width shows at most: the same on a finer sensor."""
_LAMP_MAP = 320
_LAMP_MM = 360.0
_BIAS_MM = 4.0


@dataclass(frozen=True)
class Light:
    """Of one room; colours are linear red, green, blue."""

    lamps: tuple[tuple[tuple[float, float, float], tuple[float, float, float]], ...]
    """Direction to each lamp in the camera's frame (y down), and its colour and strength."""
    room: tuple[float, float, float]
    """Light from everywhere."""
    gloss: float
    shadows: bool = True


SOFT = "soft"
HARD = "hard"


def a_light(kind: str, seed: int) -> Light:
    """``SOFT``: a bright room, one weak lamp. ``HARD``: two lamps of different colour, shadows, gloss."""
    rng = np.random.default_rng([seed, 51])

    def lamp(strength: float, warm: float) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
        way = np.array([rng.uniform(-1.0, 1.0), rng.uniform(-1.2, -0.1), rng.uniform(-1.2, -0.5)])
        way /= np.linalg.norm(way)
        colour = strength * np.array([1.0 + warm, 1.0, 1.0 - warm])
        return (tuple(map(float, way)), tuple(map(float, colour)))  # type: ignore[return-value]

    if kind == SOFT:
        return Light((lamp(0.3, rng.uniform(-0.05, 0.1)),), (0.62, 0.62, 0.6), 0.04)
    lamps = (lamp(0.7, rng.uniform(0.08, 0.22)), lamp(0.45, rng.uniform(-0.2, -0.05)))
    return Light(lamps, (0.2, 0.2, 0.22), float(rng.uniform(0.08, 0.25)))


@dataclass(frozen=True, eq=False)
class LitGlove:
    """Pictures of one glove by one camera. The same seed makes the same room."""

    glove: WornGlove
    camera: Camera
    light: Light
    seed: int
    skin_clutter: bool = True
    blur_px: float = 0.7
    noise: float = 1.0
    jpeg: int | None = 88
    balanced: bool = True
    """Whether the camera's white balance took the light's mean colour away."""
    inks: np.ndarray = field(default_factory=lambda: np.asarray(PRINTED_SRGB, dtype=float))
    finer: int = _FINER
    """Samples of a pixel along each side."""

    def picture(
        self, angles_deg: np.ndarray, rotation: np.ndarray, position_mm: np.ndarray, number: int = 0
    ) -> tuple[np.ndarray, np.ndarray]:
        """Blue, green, red (H, W, 3) uint8, and the colours truly there (H, W) uint8, of a hand whose palm is
        turned and placed in the first camera's frame."""
        light, truth = self.light_of(angles_deg, rotation, position_mm)
        return self.developed(light, number), truth

    def light_of(
        self, angles_deg: np.ndarray, rotation: np.ndarray, position_mm: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """What reaches the sensor, linear red, green, blue (H, W, 3) float32, and the colours truly there
        (H, W) uint8, of a hand as ``picture`` takes it."""
        finer = self.finer
        height, width = self.camera.height, self.camera.width
        vertices = self.glove.posed(angles_deg) @ rotation.T + position_mm
        back, places = self.glove.cloth
        arm, arm_triangles = self._arm
        everything = np.concatenate([vertices, arm @ rotation.T + position_mm])
        triangles = np.concatenate([self.glove.triangles, arm_triangles + len(vertices)])
        is_glove = np.arange(len(triangles)) < len(self.glove.triangles)
        own = everything @ np.array(self.camera.rotation).T + np.array(self.camera.translation_mm)
        pixels = _projected(own, self.camera) * finer + 0.5 * (finer - 1)
        v, u, hit, share = _hit(pixels, own[:, 2], triangles, height * finer, width * finer)
        corners = triangles[hit]
        normal = np.einsum("nk,nka->na", share, _normals(own, triangles)[corners])
        normal /= np.linalg.norm(normal, axis=1, keepdims=True) + 1e-12
        point = np.einsum("nk,nka->na", share, own[corners])
        sight = -point / np.linalg.norm(point, axis=1, keepdims=True)
        normal *= np.where((normal * sight).sum(axis=1) < 0, -1.0, 1.0)[:, None]
        labels = np.zeros(len(hit), dtype=np.uint8)
        on_glove = is_glove[hit]
        place = np.einsum("nk,nka->na", share[on_glove], places[corners[on_glove]])
        labels[on_glove] = self.glove.colours(back[corners[on_glove, 0]], place)
        albedo = np.vstack([self._arm_light, _linear(self.inks)])[labels]
        albedo = albedo * self._weave[v, u][:, None]
        lit = np.tile(np.array(self.light.room), (len(hit), 1)) * (0.8 - 0.2 * normal[:, 1:2])
        shine = np.zeros((len(hit), 3))
        for towards, colour in self.light.lamps:
            way, strength = np.array(towards), np.array(colour)
            facing = np.clip(normal @ way, 0.0, 1.0)
            if self.light.shadows:
                facing = facing * _in_light(own, triangles, point, way)
            lit += facing[:, None] * strength
            half = way + sight
            half /= np.linalg.norm(half, axis=1, keepdims=True)
            bright = np.clip((normal * half).sum(axis=1), 0.0, 1.0) ** 24 * (facing > 0)
            shine += self.light.gloss * bright[:, None] * strength
        light = albedo * lit + shine * on_glove[:, None]
        pixel, slot = np.unique(v // finer * width + u // finer, return_inverse=True)
        covered = np.bincount(slot)[:, None] / finer**2
        light = np.stack([np.bincount(slot, light[:, c]) for c in range(3)], axis=-1) / finer**2
        picture = self._behind.astype(np.float32)
        behind = self._behind.reshape(-1, 3)[pixel]
        picture.reshape(-1, 3)[pixel] = behind * (1.0 - covered) + light
        truth = np.zeros((height, width), dtype=np.uint8)
        middle = (v % finer == finer // 2) & (u % finer == finer // 2)
        truth[v[middle] // finer, u[middle] // finer] = labels[middle]
        return picture, truth

    def developed(self, light: np.ndarray, number: int) -> np.ndarray:
        """Blue, green, red (H, W, 3) uint8, by a sensor of as many pixels as ``light`` (H, W, 3) has; its
        blur and noise are those of a pixel, whatever the size. ``number`` is of the picture, for its noise.
        """
        rng = np.random.default_rng([self.seed, 52, number])
        total = np.array(self.light.room) + sum(0.5 * np.array(colour) for _, colour in self.light.lamps)
        gain = 0.9 / total.max() * (total.max() / total if self.balanced else np.ones(3))
        light = cv2.GaussianBlur(light, (0, 0), self.blur_px) * gain.astype(np.float32)
        grain = rng.standard_normal(light.shape, dtype=np.float32)
        light += np.float32(self.noise) * np.sqrt(np.maximum(light, 0) * 4e-4 + 4e-6) * grain
        share = np.clip(light, 0.0, 1.0)
        coded = np.where(share <= 0.0031308, 12.92 * share, 1.055 * share ** (1 / 2.4) - 0.055)
        picture = np.ascontiguousarray(np.rint(255 * coded).astype(np.uint8)[..., ::-1])
        if self.jpeg is None:
            return picture
        _, data = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, self.jpeg])
        return np.asarray(cv2.imdecode(data, cv2.IMREAD_COLOR))

    @cached_property
    def _weave(self) -> np.ndarray:
        rng = np.random.default_rng([self.seed, 53])
        height, width = self.camera.height * self.finer, self.camera.width * self.finer
        share = min(1.0, _WEAVE_ACROSS / width)
        threads = 1.0 + 0.06 * rng.standard_normal((round(height * share), round(width * share)))
        return cv2.resize(threads, (width, height), interpolation=cv2.INTER_NEAREST)

    @cached_property
    def _skin(self) -> np.ndarray:
        tones = ((229, 190, 165), (198, 146, 112), (150, 101, 71), (98, 63, 46))
        return np.array(tones[self.seed % len(tones)], dtype=float)

    @cached_property
    def _arm_light(self) -> np.ndarray:
        rng = np.random.default_rng([self.seed, 54])
        sleeve = rng.uniform(20, 190, 3)
        return _linear(self._skin if rng.random() < 0.6 else sleeve)

    @cached_property
    def _arm(self) -> tuple[np.ndarray, np.ndarray]:
        """From inside the hem to the elbow."""
        length = self.glove.fit.length_mm
        along = np.linspace(-0.05 * length, -280.0, 9)
        radius = np.interp(along, [-280.0, -0.05 * length], [45.0, 0.125 * length])
        turn = np.linspace(0.0, 2 * np.pi, 24, endpoint=False)
        rings = np.stack(
            [
                np.repeat(along[:, None], 24, axis=1),
                radius[:, None] * 1.08 * np.cos(turn),
                radius[:, None] * 0.78 * np.sin(turn),
            ],
            axis=-1,
        )
        found = []
        for ring in range(8):
            for step in range(24):
                a, b = ring * 24 + step, ring * 24 + (step + 1) % 24
                found += [(a, a + 24, b), (b, a + 24, b + 24)]
        return rings.reshape(-1, 3), np.array(found, dtype=np.int32)

    @cached_property
    def _behind(self) -> np.ndarray:
        """A room out of focus, linear."""
        rng = np.random.default_rng([self.seed, 55])
        height, width = self.camera.height, self.camera.width
        wall = rng.uniform(70, 215) + rng.normal(0, 10, 3)
        picture: np.ndarray = np.tile(wall, (height, width, 1))
        picture += (
            22.0 * zoom(rng.normal(size=(5, 7)), (height / 5, width / 7), order=1)[:height, :width, None]
        )
        for _ in range(int(rng.integers(5, 14))):
            colour = rng.uniform(20, 235, 3)
            grey = colour.mean()
            colour = grey + rng.uniform(0.1, 0.9) * (colour - grey)
            top, left = int(rng.integers(0, height)), int(rng.integers(0, width))
            tall, wide = (int(v) for v in rng.uniform(0.03, 0.3, 2) * height)
            picture[top : top + tall, left : left + wide] = colour
        if self.skin_clutter:  # a face, the other hand
            for _ in range(2):
                place = (int(rng.uniform(0, width)), int(rng.uniform(0, height)))
                size = tuple(int(v) for v in rng.uniform(0.06, 0.17, 2) * height)
                cv2.ellipse(picture, place, size, float(rng.uniform(0, 180)), 0, 360, self._skin.tolist(), -1)
        picture = gaussian_filter(np.clip(picture, 0, 255), (0.002 * width, 0.002 * width, 0))
        return _linear(picture) * (np.array(self.light.room) + 0.35)


def averaged(light: np.ndarray, width: int) -> np.ndarray:
    """(H, W, 3): what a sensor ``width`` pixels across gets of ``light``, each pixel the mean of what it
    covers."""
    size = width, round(light.shape[0] * width / light.shape[1])
    return cv2.resize(light, size, interpolation=cv2.INTER_AREA)


def _linear(srgb: np.ndarray) -> np.ndarray:
    share = np.asarray(srgb, dtype=float) / 255.0
    return np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)


def _projected(points: np.ndarray, camera: Camera) -> np.ndarray:
    """Brown's lens, written anew."""
    a, b = points[:, 0] / points[:, 2], points[:, 1] / points[:, 2]
    k1, k2, p1, p2, k3 = camera.distortion
    square = a * a + b * b
    radial = 1 + square * (k1 + square * (k2 + square * k3))
    x = a * radial + 2 * p1 * a * b + p2 * (square + 2 * a * a)
    y = b * radial + p1 * (square + 2 * b * b) + 2 * p2 * a * b
    return np.column_stack([x, y]) * camera.focal_px + camera.centre_px


def _normals(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    a, b, c = (points[triangles[:, corner]] for corner in range(3))
    across = np.cross(b - a, c - a)
    found = np.zeros_like(points)
    for corner in range(3):
        np.add.at(found, triangles[:, corner], across)
    return found / (np.linalg.norm(found, axis=1, keepdims=True) + 1e-12)


def _hit(
    pixels: np.ndarray, depth: np.ndarray, triangles: np.ndarray, height: int, width: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Rows and columns (N,) of what any triangle covers, the nearest one (N,), shares of its corners (N, 3):
    filled in their own box, which on a fine sensor is far smaller than the picture."""
    ahead = pixels[depth >= 20.0]
    left, top = np.clip(np.floor(ahead.min(axis=0)), 0, (width, height)).astype(int)
    right, bottom = np.clip(np.ceil(ahead.max(axis=0)) + 1, 0, (width, height)).astype(int)
    which, shares, _ = _filled(pixels - (left, top), depth, triangles, bottom - top, right - left)
    v, u = np.nonzero(which >= 0)
    return v + top, u + left, which[v, u], shares[v, u]


@numba.njit(cache=True)
def _filled(pixels, depth, triangles, height, width):  # type: ignore[no-untyped-def]
    """Nearest triangle of each pixel, the shares of its corners there as seen in perspective, its depth."""
    which = np.full((height, width), -1, np.int32)
    shares = np.zeros((height, width, 3))
    nearest = np.full((height, width), np.inf)
    for index in range(len(triangles)):
        a, b, c = triangles[index]
        if depth[a] < 20.0 or depth[b] < 20.0 or depth[c] < 20.0:
            continue
        x0, y0 = pixels[a]
        x1, y1 = pixels[b]
        x2, y2 = pixels[c]
        double = (x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0)
        if abs(double) < 1e-9:
            continue
        for v in range(
            max(0, int(np.ceil(min(y0, y1, y2)))), min(height - 1, int(np.floor(max(y0, y1, y2)))) + 1
        ):
            for u in range(
                max(0, int(np.ceil(min(x0, x1, x2)))), min(width - 1, int(np.floor(max(x0, x1, x2)))) + 1
            ):
                second = ((u - x0) * (y2 - y0) - (x2 - x0) * (v - y0)) / double
                third = ((x1 - x0) * (v - y0) - (u - x0) * (y1 - y0)) / double
                first = 1.0 - second - third
                if first < 0.0 or second < 0.0 or third < 0.0:
                    continue
                p, q, r = first / depth[a], second / depth[b], third / depth[c]
                away = 1.0 / (p + q + r)
                if away < nearest[v, u]:
                    nearest[v, u] = away
                    which[v, u] = index
                    shares[v, u, 0], shares[v, u, 1], shares[v, u, 2] = p * away, q * away, r * away
    return which, shares, nearest


def _in_light(points: np.ndarray, triangles: np.ndarray, asked: np.ndarray, way: np.ndarray) -> np.ndarray:
    """(N,) 0 to 1: how much of a far lamp in direction ``way`` reaches places ``asked``."""
    up = np.array([0.0, 1.0, 0.0]) if abs(way[1]) < 0.9 else np.array([1.0, 0.0, 0.0])
    right = np.cross(up, way)
    right /= np.linalg.norm(right)
    frame = np.stack([right, np.cross(way, right), -way])
    centre = np.median(asked, axis=0)
    scale = _LAMP_MAP / _LAMP_MM
    seen = (points - centre) @ frame.T
    flat = seen[:, :2] * scale + _LAMP_MAP / 2
    depth = seen[:, 2] + 2000.0
    _, _, nearest = _filled(flat, depth, triangles, _LAMP_MAP, _LAMP_MAP)
    own = (asked - centre) @ frame.T
    return _reached(nearest, own[:, :2] * scale + _LAMP_MAP / 2, own[:, 2] + 2000.0 - _BIAS_MM)


@numba.njit(cache=True)
def _reached(nearest, place, depth):  # type: ignore[no-untyped-def]
    """Of five places around each, how many the lamp sees: edges of shadows are soft."""
    found, last = np.zeros(len(depth)), len(nearest) - 1
    for index in range(len(depth)):
        u, v = int(place[index, 0]), int(place[index, 1])
        for du, dv in ((0, 0), (1, 0), (-1, 0), (0, 1), (0, -1)):
            column, row = min(max(u + du, 0), last), min(max(v + dv, 0), last)
            found[index] += 0.2 * (depth[index] <= nearest[row, column])
    return found


# How the hand moves.


_TARGETS = {
    "T_TMC": (-10.0, 45.0), "TI_ABD": (5.0, 60.0), "T_VIR": (0.0, 55.0), "T_MCP": (-5.0, 50.0),
    "T_IP": (-10.0, 70.0), "MCP": (-15.0, 85.0), "PIP": (0.0, 100.0), "ABD": (-3.0, 20.0),
}  # fmt: skip


def free_motion(seconds: float, rate_hz: float, seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Angles (N, 20), the palm's turns (N, 3, 3) and wrists (N, 3) mm before a camera: fingers go from one
    drawn target to the next, each on its own or together, and rest there."""
    rng = np.random.default_rng([seed, 56])
    time = np.arange(0.0, seconds, 1.0 / rate_hz)
    angles = np.empty((len(time), len(ROTATIONS)))
    together = _between(rng, time, 0.0, 1.0)
    for column, name in enumerate(ROTATIONS):
        joint = name.rpartition("_")[2]
        if joint == "DIP":
            continue
        low, high = _TARGETS[name if name[0] == "T" else joint]
        own = _between(rng, time, 0.0, 1.0)
        share = 0.55 * together + 0.45 * own if joint in ("MCP", "PIP") and name[0] != "T" else own
        angles[:, column] = low + (high - low) * np.clip(1.25 * share - 0.125, 0.0, 1.0)
    for finger in "IMRP":
        bent = angles[:, ROTATIONS.index(f"{finger}_PIP")]
        own = 0.62 * bent + 9.0 * (_between(rng, time, -1.0, 1.0))
        angles[:, ROTATIONS.index(f"{finger}_DIP")] = np.clip(own, -5.0, 80.0)
    for name, knuckle in (("IM_ABD", "I"), ("MR_ABD", "R"), ("RP_ABD", "P")):
        bent = np.clip(angles[:, ROTATIONS.index(f"{knuckle}_MCP")] / 85.0, 0.0, 1.0)
        angles[:, ROTATIONS.index(name)] *= 1.0 - 0.75 * bent
    facing = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    swing = np.column_stack([_between(rng, time, -40.0, 40.0) for _ in range(3)])
    over = 180.0 * np.clip(6.0 * (_between(rng, time, 0.0, 1.0, 4.0) - 0.65), 0.0, 1.0)
    around = Rotation.from_rotvec(over[:, None] * np.array([0.0, 1.0, 0.0]), degrees=True)
    turned = Rotation.from_euler("xyz", swing, degrees=True) * around
    turns = turned.as_matrix() @ facing
    depth = _between(rng, time, 380.0, 560.0, 2.5)
    aside = np.column_stack(
        [depth * _between(rng, time, -0.16, 0.16), depth * _between(rng, time, -0.1, 0.12)]
    )
    middle = np.column_stack([aside, depth])
    return angles, turns, middle - turns @ np.array([85.0, 0.0, 0.0])


def _between(
    rng: np.random.Generator, time: np.ndarray, low: float, high: float, rests: float = 1.0
) -> np.ndarray:
    found, at, value = np.empty(len(time)), 0.0, rng.uniform(low, high)
    while at <= (time[-1] if len(time) else 0.0):
        hold, change, following = rests * rng.uniform(0.1, 0.8), rng.uniform(0.3, 0.9), rng.uniform(low, high)
        share = np.clip((time - at - hold) / change, 0.0, 1.0)
        now = time >= at
        found[now] = value + (following - value) * (share**2 * (3 - 2 * share))[now]
        at, value = at + hold + change, following
    return found


def other_camera(seed: int, width: int = 640, height: int = 480) -> Camera:
    """Another lens than the one assumed: 588 pixels at 640, a little barrel."""
    rng = np.random.default_rng([seed, 57])
    focal = 588.0 * width / 640
    centre = ((width - 1) / 2 + rng.normal(0, 4), (height - 1) / 2 + rng.normal(0, 4))
    lens = (float(rng.normal(-0.12, 0.03)), float(rng.normal(0.05, 0.02)), 0.0005, -0.0004, 0.0)
    return Camera(width, height, (focal, focal), centre, lens)
