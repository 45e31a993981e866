"""Tiny images of many hands in many turns, with what is known of each: what a picture is looked up in.

Wang & Popovic 2009, section 4.2: configurations that cover the natural ones evenly, each rendered in several
orientations at a fixed distance from a virtual camera. An entry keeps its tiny image, the distance transform
of it (so that a look-up need not make it anew), and the centroids of its patches. A database lies in a folder
named after a hash of everything it was built from, as plain arrays that are mapped, not read.
"""

from __future__ import annotations

import hashlib
import itertools
import json
import os
import shutil
import time
from contextlib import suppress
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from tempfile import mkdtemp

import numba
import numpy as np

from glovecal_models.colour_glove.crop import (
    BANDWIDTH_SD,
    CAP,
    SIZE,
    Window,
    shifted_window,
    transform_into,
    voted,
)
from glovecal_models.colour_glove.hand_state import FINGER_ROTATIONS, HandState
from glovecal_models.colour_glove.pattern import Pattern
from glovecal_models.colour_glove.pose_set import low_dispersion, shape_features
from glovecal_models.colour_glove.rasterise import z_buffer
from glovecal_models.colour_glove.skin import HandSkin, posed
from glovecal_models.errors import BadInput
from glovecal_models.progress import Cancel, Report, part, stop_if
from glovecal_models.worker_processes import work_off

ENTRIES, PAPER_ENTRIES, MOST_ENTRIES = 20_000, 100_000, 1_000_000
VIEW_PX, VIEW_FOCAL_PX, VIEW_DISTANCE_MM = 128, 230.0, 500.0
"""The virtual camera: a spread hand fills most of its picture."""
FORMAT = 1
"""Of the folder; part of the hash."""
ENTRY_BYTES = 18_000
MOST_DATABASE_BYTES = 8_000_000_000
"""Of all databases in a folder: four of 100,000 entries, twenty of the usual size."""
SPARED_BYTES = 500_000_000
"""Is left to recordings."""
ABANDONED_AFTER_S = 86_400.0
_AT_ONCE = 500
_ARRAYS = ("angles_deg", "rotations", "tiny", "transforms", "centroids", "areas", "windows")


@dataclass(frozen=True)
class DatabaseSettings:
    """Raises BadInput for sizes that make no database."""

    entries: int = ENTRIES
    configurations: int | None = None
    """Different finger configurations among the entries; None: about ``entries`` ** 0.75."""
    cone_deg: float = 75.0
    """The fingers point at most so far away from the picture's upper edge; 180: anywhere."""
    sampling: str = "random"
    """Of configurations; "low-dispersion" as in the paper errs less at worst, "random" less in the mean."""
    seed: int = 1

    def __post_init__(self) -> None:
        if not 1 <= self.entries <= MOST_ENTRIES:
            raise BadInput(f"a database of {self.entries} entries; 1 to {MOST_ENTRIES} are possible")
        if self.configurations is not None and not 1 <= self.configurations <= self.entries:
            raise BadInput(f"{self.configurations} configurations in {self.entries} entries")
        if not 0 < self.cone_deg <= 180:
            raise BadInput(f"a cone of {self.cone_deg} degrees; expected above 0, at most 180")
        if self.sampling not in ("low-dispersion", "random"):
            raise BadInput(f"sampling {self.sampling!r}; there are low-dispersion and random")


@dataclass(frozen=True, eq=False)
class PoseDatabase:
    """N entries; arrays are mapped from the folder and read-only."""

    folder: Path
    angles_deg: np.ndarray
    """(N, 20) float32."""
    rotations: np.ndarray
    """(N, 3, 3) float32, palm to camera, seen along the camera's axis."""
    tiny: np.ndarray
    """(N, 40, 40) uint8 labels."""
    transforms: np.ndarray
    """(N, C, 40, 40) uint8, see ``image_distance``."""
    centroids: np.ndarray
    """(N, P, 2) float32 of the visible patches, in pixels of the tiny image; NaN: not visible."""
    areas: np.ndarray
    """(N, P) float32: of the patches, in pixels of the tiny image."""
    windows: np.ndarray
    """(N, 3) float32: u, v, half side of the crop in the virtual camera's picture."""
    palm_centre_mm: np.ndarray
    """(3,) in the palm's frame: the point that lay ``VIEW_DISTANCE_MM`` before the virtual camera."""

    def __len__(self) -> int:
        return len(self.tiny)

    def state(self, entry: int) -> HandState:
        """The hand as it was rendered, before the virtual camera."""
        return view_state(self.angles_deg[entry], self.rotations[entry], self.palm_centre_mm)

    def window(self, entry: int) -> Window:
        return Window(*(float(value) for value in self.windows[entry]))


def view_state(angles_deg: np.ndarray, rotation: np.ndarray, palm_centre_mm: np.ndarray) -> HandState:
    """A hand whose palm's centre lies on the virtual camera's axis. ``rotation`` may be single precision."""
    left, _, right = np.linalg.svd(np.asarray(rotation, dtype=float))
    turn = left @ right
    ahead = np.array([0.0, 0.0, VIEW_DISTANCE_MM])
    return HandState(np.asarray(angles_deg, dtype=float), turn, ahead - turn @ palm_centre_mm)


def pose_database(
    skin: HandSkin,
    pattern: Pattern,
    poses_deg: np.ndarray,
    folder: Path,
    settings: DatabaseSettings | None = None,
    *,
    workers: int | None = None,
    report: Report | None = None,
    cancelled: Cancel | None = None,
) -> PoseDatabase:
    """The database of these arguments: mapped from ``folder`` when it is there, else built into it.

    ``poses_deg`` (M, 20): what configurations are chosen from. Raises BadInput for arrays that do not fit,
    Cancelled; nothing is left behind then. Bytes on disk: about 18,000 an entry.
    """
    settings = DatabaseSettings() if settings is None else settings
    poses = np.ascontiguousarray(poses_deg, dtype=float)
    if poses.ndim != 2 or poses.shape[1] != len(FINGER_ROTATIONS) or not len(poses):
        raise BadInput(f"poses have shape {poses.shape}, expected (M, {len(FINGER_ROTATIONS)})")
    if not np.isfinite(poses).all():
        raise BadInput("poses hold angles that are not finite")
    if len(pattern.patch) != len(skin.triangles):
        raise BadInput(f"a pattern for {len(pattern.patch)} triangles on a skin of {len(skin.triangles)}")
    name = _digest(skin, pattern, poses, settings)
    place = folder / f"colour-glove-{name}"
    found = _mapped(place, skin)
    if found is None:
        folder.mkdir(parents=True, exist_ok=True)
        _make_room(folder, ENTRY_BYTES * settings.entries)
        unfinished = Path(mkdtemp(prefix=f"{place.name}-", dir=folder))
        try:
            _build(unfinished, skin, pattern, poses, settings, workers, report, cancelled)
            if place.exists():  # damaged, or another process was quicker
                shutil.rmtree(place, ignore_errors=True)
            unfinished.rename(place)
        except BaseException:
            shutil.rmtree(unfinished, ignore_errors=True)
            raise
        found = _mapped(place, skin)
        if found is None:
            raise BadInput(f"the database just written to {place} cannot be read; is the disk full?")
    with suppress(OSError):
        os.utime(place)  # used last: others go first when room is needed
    if report:
        report(f"{len(found)} entries", 1.0)
    return found


def _make_room(folder: Path, needed: int) -> None:
    """Remove databases, those used longest ago first, until all together keep below ``MOST_DATABASE_BYTES``
    with the one to come, and what killed builders left. Raises BadInput where the disk has no room then.

    One that is removed is built again when it is asked for."""
    kept = 0
    places = [place for place in folder.glob("colour-glove-*") if place.is_dir()]
    for place in sorted(places, key=_used_at, reverse=True):
        kept += sum(file.stat().st_size for file in place.iterdir())
        is_whole = (place / "database.json").exists()
        abandoned = not is_whole and time.time() - _used_at(place) > ABANDONED_AFTER_S
        if abandoned or (is_whole and kept + needed > MOST_DATABASE_BYTES):
            shutil.rmtree(place, ignore_errors=True)
    free = shutil.disk_usage(folder).free
    if free < needed + SPARED_BYTES:
        raise BadInput(
            f"the pose database takes {needed / 1e9:.1f} GB, and {folder} has {free / 1e9:.1f} GB free: free "
            "some disk space, or ask for fewer entries"
        )


def _used_at(place: Path) -> float:
    try:
        return place.stat().st_mtime
    except OSError:
        return 0.0


def _digest(skin: HandSkin, pattern: Pattern, poses: np.ndarray, settings: DatabaseSettings) -> str:
    constants = [FORMAT, VIEW_PX, VIEW_FOCAL_PX, VIEW_DISTANCE_MM, CAP, SIZE, BANDWIDTH_SD]
    found = hashlib.sha256(json.dumps([constants, asdict(settings), skin.skeleton.hand]).encode())
    arrays = [skin.vertices_mm, skin.triangles, skin.joints, skin.weights, *skin.chain]
    for array in (*arrays, pattern.patch, pattern.colour_of_patch, poses):
        found.update(repr((array.shape, array.dtype.str)).encode())
        found.update(np.ascontiguousarray(array).tobytes())
    return found.hexdigest()[:20]


def _mapped(place: Path, skin: HandSkin) -> PoseDatabase | None:
    """What lies there; None where it is missing, or not what its list says."""
    try:
        listed = json.loads((place / "database.json").read_text(encoding="utf-8"))
        arrays = {name: np.load(place / f"{name}.npy", mmap_mode="r", allow_pickle=False) for name in _ARRAYS}
    except (OSError, ValueError, EOFError):
        return None
    if any(list(array.shape) != listed.get(name) for name, array in arrays.items()):
        return None
    return PoseDatabase(place, palm_centre_mm=palm_centre(skin), **arrays)


def palm_centre(skin: HandSkin) -> np.ndarray:
    """(3,) in the palm's frame: on the middle metacarpal, near the knuckle."""
    return np.array([0.42 * skin.skeleton.dimensions.hand_length_mm, 0.0, 0.0])


def _build(
    place: Path,
    skin: HandSkin,
    pattern: Pattern,
    poses: np.ndarray,
    settings: DatabaseSettings,
    workers: int | None,
    report: Report | None,
    cancelled: Cancel | None,
) -> None:
    count, patches, colours = settings.entries, len(pattern.colour_of_patch), max(10, pattern.colours)
    if report:
        report("choosing configurations", 0.0)
    chosen = _configurations(skin, poses, settings)
    stop_if(cancelled, "building the database")
    rng = np.random.default_rng(settings.seed)
    angles = chosen[rng.permutation(np.arange(count) % len(chosen))]
    rotations = orientations(count, settings.cone_deg, rng)
    shapes = {
        "angles_deg": ((count, 20), np.float32), "rotations": ((count, 3, 3), np.float32),
        "tiny": ((count, SIZE, SIZE), np.uint8), "transforms": ((count, colours, SIZE, SIZE), np.uint8),
        "centroids": ((count, patches, 2), np.float32), "areas": ((count, patches), np.float32),
        "windows": ((count, 3), np.float32),
    }  # fmt: skip
    arrays = {
        name: np.lib.format.open_memmap(place / f"{name}.npy", "w+", dtype, shape)
        for name, (shape, dtype) in shapes.items()
    }
    arrays["angles_deg"][:], arrays["rotations"][:] = angles, rotations
    for array in arrays.values():
        array.flush()
    del arrays
    lows = range(0, count, _AT_ONCE)
    workers = min(workers or os.cpu_count() or 1, len(lows))
    said = part(report, 0.1, 1.0)
    done = itertools.count(1)

    def rendered(*_: object) -> None:
        if said:
            said("rendering", next(done) / len(lows))

    entries = partial(_render_entries, place, skin, pattern)
    work_off(entries, lows, workers, rendered, "building the database", cancelled)
    listed = {name: shape for name, (shape, _) in shapes.items()}
    (place / "database.json").write_text(json.dumps(listed), encoding="utf-8")


def _configurations(skin: HandSkin, poses: np.ndarray, settings: DatabaseSettings) -> np.ndarray:
    wanted = settings.configurations or max(1, round(settings.entries**0.75))
    wanted = min(wanted, len(poses))
    if settings.sampling == "random":
        return np.random.default_rng([settings.seed, 1]).permutation(poses)[:wanted]
    return poses[low_dispersion(shape_features(skin, poses), wanted)[0]]


def orientations(count: int, cone_deg: float, rng: np.random.Generator) -> np.ndarray:
    """(N, 3, 3), uniform among those whose fingers point within ``cone_deg`` of the picture's upper edge."""
    from scipy.spatial.transform import Rotation

    # Fingers (x of the palm) in a cap of the sphere about -y of the camera, then any turn about themselves.
    height = rng.uniform(np.cos(np.radians(cone_deg)), 1.0, count)
    around, roll = rng.uniform(0, 2 * np.pi, (2, count))
    away = np.sqrt(1 - height**2)
    fingers = np.column_stack([away * np.cos(around), -height, away * np.sin(around)])
    helper = np.where(np.abs(fingers[:, [0]]) < 0.9, [[1.0, 0.0, 0.0]], [[0.0, 0.0, 1.0]])
    across = np.cross(fingers, helper)
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    frame = np.stack([fingers, across, np.cross(fingers, across)], axis=2)
    return frame @ Rotation.from_euler("x", roll[:, None]).as_matrix()


def _render_entries(place: Path, skin: HandSkin, pattern: Pattern, low: int) -> None:
    """Entries from ``low`` on, into the arrays in ``place``."""
    arrays = {name: np.load(place / f"{name}.npy", mmap_mode="r+", allow_pickle=False) for name in _ARRAYS}
    cut = {name: array[low : low + _AT_ONCE] for name, array in arrays.items()}
    views = rendered_views(skin, pattern, cut["angles_deg"], cut["rotations"], cut["transforms"].shape[1])
    for name, values in views.items():
        cut[name][:] = values


def rendered_views(
    skin: HandSkin,
    pattern: Pattern,
    angles_deg: np.ndarray,
    rotations: np.ndarray,
    colours: int = 10,
) -> dict[str, np.ndarray]:
    """What a database keeps of hands (N, 20), (N, 3, 3) before its virtual camera: ``tiny``, ``transforms``,
    ``centroids``, ``areas``, ``windows``. The same hands give the same images in a database and here."""
    count, patches, centre = len(angles_deg), len(pattern.colour_of_patch), palm_centre(skin)
    tiny = np.empty((count, SIZE, SIZE), np.uint8)
    transforms = np.empty((count, colours, SIZE, SIZE), np.uint8)
    centroids = np.empty((count, patches, 2), np.float32)
    areas, windows = np.empty((count, patches), np.float32), np.empty((count, 3), np.float32)
    colour_of = np.append(0, pattern.colour_of_patch).astype(np.uint8)
    patch_of = np.append(pattern.patch, 0).astype(np.uint8)
    for entry in range(count):
        seen = posed(skin, view_state(angles_deg[entry], rotations[entry], centre))
        pixels = seen[:, :2] * (VIEW_FOCAL_PX / seen[:, 2:]) + (VIEW_PX - 1) / 2
        shown, _ = z_buffer(pixels, seen[:, 2].copy(), skin.triangles, VIEW_PX, VIEW_PX)
        patch = patch_of[shown]
        labels = colour_of[patch]
        u, v, half = windows[entry] = shifted_window(labels)
        tiny[entry] = voted(labels, u, v, half)
        transform_into(tiny[entry], transforms[entry])
        sums = patch_sums(patch, patches)
        with np.errstate(invalid="ignore"):
            middles = sums[:, 1:] / sums[:, :1]
        centroids[entry] = Window(u, v, half).to_tiny(middles)
        areas[entry] = sums[:, 0] * (SIZE / (2 * half)) ** 2
    found = (tiny, transforms, centroids, areas, windows)
    return dict(zip(_ARRAYS[2:], found, strict=True))


@numba.njit(cache=True)
def patch_sums(patch, patches):  # type: ignore[no-untyped-def]
    """Kernel: pixels, sum of u and sum of v of each patch 1 to P in a patch image, (P, 3)."""
    found = np.zeros((patches, 3))
    for v in range(patch.shape[0]):
        for u in range(patch.shape[1]):
            if patch[v, u]:
                found[patch[v, u] - 1, 0] += 1.0
                found[patch[v, u] - 1, 1] += u
                found[patch[v, u] - 1, 2] += v
    return found
