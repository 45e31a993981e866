"""Everything that cameras' pictures are tracked with: built once, or taken from the data folder.

Colours are told by a table that is learned on drawings, or on pictures that somebody has labelled. Gains of
red, green and blue, told from the last pictures of the glove, correct them for the light; a table drawn for a
hand and its pattern is drawn anew in that light.
"""

from __future__ import annotations

import hashlib
import os
import time
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from glovecal_client.errors import BadOption
from glovecal_client.operating_system import move_over
from glovecal_client.pictures.label_file import LabelFilePictures
from glovecal_client.pictures.source import PictureSource, RenderedPictures, build_source
from glovecal_models.colour_glove.camera_model import Camera, read_cameras
from glovecal_models.colour_glove.hand_shape import HandShape, read_shape
from glovecal_models.colour_glove.hand_state import HandState
from glovecal_models.colour_glove.pattern import COLOURS, Pattern, printed_pattern
from glovecal_models.colour_glove.photograph import (
    Photographer,
    Photography,
)
from glovecal_models.colour_glove.pictures.classify import ColourTable, drawn_colours
from glovecal_models.colour_glove.pictures.picture_check import PictureCheck
from glovecal_models.colour_glove.pictures.white_balance import CardColours, Gains, blind_gains
from glovecal_models.colour_glove.pose.both_ways import Follows
from glovecal_models.colour_glove.pose.hand_tracker import HandTracker, prepared_tracker, with_shape
from glovecal_models.colour_glove.pose.window_view import PrintedHand
from glovecal_models.colour_glove.pose_set import hand_shapes
from glovecal_models.colour_glove.rasterise import rasterise
from glovecal_models.colour_glove.skin import HandSkin, hand_skin, posed
from glovecal_models.errors import BadInput
from glovecal_models.hand.dimensions import HandDimensions
from glovecal_models.hand.skeleton import hand_skeleton
from glovecal_models.progress import Cancel, Report
from glovecal_service.camera.camera_settings import TrackingSettings

LABELS = ".labels.png"
"""What stands in place of a picture's suffix in the name of its label image."""


def drawn_table(
    skin: HandSkin | None = None, pattern: Pattern | None = None, card: CardColours | None = None
) -> ColourTable:
    """Learned on drawn photographs of the printed colours in white light; with ``card`` of the colours, and
    in the light, that its pictures tell."""
    skin = hand_skin() if skin is None else skin
    pattern = printed_pattern() if pattern is None else pattern
    inks, gains = None, (1.0, 1.0, 1.0)
    if card is not None:
        inks, gains = card.inks, (1.0 / card.gains.red, 1.0 / card.gains.green, 1.0 / card.gains.blue)
    return drawn_colours(skin, pattern, inks=inks, gains=gains)


def labelled_table(files: Sequence[Path]) -> ColourTable:
    """From pictures beside each of which lies a label image of its size: ``hand.jpg`` and
    ``hand.labels.png``, grey levels 0 (no glove) to 10. Raises BadInput for files that are none and for a
    colour that is missing."""
    pictures, labels = [picture_file(file) for file in files], []
    for file, picture in zip(files, pictures, strict=True):
        beside = file.with_name(file.stem + LABELS)
        label = _read(beside, cv2.IMREAD_UNCHANGED)
        if label is None or label.dtype != np.uint8 or label.shape != picture.shape[:2]:
            raise BadInput(
                f"{beside} must be a grey picture of {picture.shape[1]} x {picture.shape[0]} pixels, 8 bits, "
                f"whose levels are the glove's colours: 0 (none) to {COLOURS}"
            )
        if label.max() > COLOURS:
            raise BadInput(f"{beside} has level {label.max()}; colours are 0 (none) to {COLOURS}")
        labels.append(label)
    for colour in range(COLOURS + 1):
        if not any((label == colour).any() for label in labels):
            raise BadInput(
                f"colour {colour} is in none of the {len(labels)} label images; show all {COLOURS}"
            )
    return ColourTable.trained(pictures, labels)


def picture_file(file: Path) -> np.ndarray:
    """(H, W, 3) uint8 blue, green, red. Raises BadInput for a file that is no picture."""
    picture = _read(file, cv2.IMREAD_COLOR)
    if picture is None:
        raise BadInput(f"{file} cannot be read as a picture")
    return picture


def _read(file: Path, how: int) -> np.ndarray | None:
    try:
        content = np.frombuffer(file.read_bytes(), np.uint8)
    except OSError:
        return None
    return cv2.imdecode(content, how) if len(content) else None


ASSUMED = Camera()
LEARNED = 3
"""Grows when what is learned from drawn photographs, colours and errors, is learned anew."""


@dataclass(frozen=True, eq=False)
class TrackingSetup:
    """For one hand before one camera or more."""

    sources: tuple[PictureSource, ...]
    """Not open."""
    hand: PrintedHand
    cameras: tuple[Camera, ...]
    """One for each source, at the size at which its pictures are looked at."""
    sizes: tuple[tuple[int, int], ...]
    """Width and height of each source's pictures as they come."""
    is_calibrated: bool
    """Whether focal length and distortion are known, not assumed."""
    colours: ColourTable
    check: PictureCheck
    first: HandTracker
    """Of which other stages take database and errors."""
    made_from: str
    mirrored: bool = False
    """Whether left and right of the pictures are exchanged, and are put back."""

    def seen(self, pixels: np.ndarray, number: int = 0) -> np.ndarray:
        """A picture (H, W, 3), or labels (H, W), of source ``number`` as it is looked at. Raises BadInput for
        another size than its camera's."""
        size = pixels.shape[1], pixels.shape[0]
        if size != self.sizes[number]:
            width, height = self.sizes[number]
            raise BadInput(
                f"the picture is {size[0]} x {size[1]}, the camera is calibrated for {width} x {height}: "
                "calibrate it at this size"
            )
        return at_working_size(
            pixels, mirrored=self.mirrored and pixels.ndim == 3
        )  # kept labels were put back

    def labels(self, seen: np.ndarray) -> np.ndarray:
        """(H, W) of what ``seen`` gave; what is labels already comes back as it is."""
        return seen if seen.ndim == 2 else self.colours.labels(seen)

    def tracker(self, stage: str) -> Follows:
        """A new one, which has seen nothing yet. Raises BadInput for an unknown stage."""
        first = self.first
        return HandTracker(first.hand, first.lookup, first.cameras, first.errors, stage=stage)

    def fitted(self, shape: HandShape) -> TrackingSetup:
        """For the same hand in its fitted shape."""
        first = with_shape(self.first, shape)
        return replace(self, hand=first.hand, first=first, made_from=repr((self.made_from, shape)))

    def example(self) -> np.ndarray:
        """Labels of a hand before the first camera: what kernels are compiled with before pictures wait."""
        skin, glove = self.hand.skin, RenderedGlove(self.hand, self.cameras[0])
        drawn = rasterise(posed(skin, glove.state(0.0)), skin.triangles, self.cameras[0])
        return drawn.painted(self.hand.pattern.colour)

    def name(self, stage: str) -> str:
        """64 hexadecimal digits: what poses are made with, as a calibration model's id names it."""
        return hashlib.sha256(f"{self.made_from} {stage}".encode()).hexdigest()


def tracking_setup(
    settings: TrackingSettings,
    sources: Sequence[str | PictureSource],
    report: Report | None = None,
    cancelled: Cancel | None = None,
) -> TrackingSetup:
    """``sources``: of pictures, as they are written or not yet open, one for each camera.

    Raises DeviceLost where no picture comes, BadInput for files that cannot be used, Cancelled.
    """
    hand = _hand(settings)
    built = tuple(
        camera_source(source, lambda: RenderedGlove(hand, ASSUMED)) if isinstance(source, str) else source
        for source in sources
    )
    sizes = [_size(source) for source in built]
    cameras = _cameras(settings, built, sizes)
    first = prepared_tracker(
        settings.folder, cameras, hand=hand,
        entries=settings.entries, report=report, cancelled=cancelled,
    )  # fmt: skip
    made_from = repr((first.lookup.database.folder.name, cameras, LEARNED))
    check = PictureCheck(first.lookup)
    _ = check.distance_limit_px2  # takes a moment: not while pictures wait
    is_known = settings.calibration is not None or built[0].name == RENDERED
    colours = settings.colours
    table = glove_colours(settings.folder, hand) if colours is None else ColourTable.load(colours)
    setup = TrackingSetup(
        built, hand, cameras, tuple(sizes), is_known, table, check, first, made_from, settings.mirrored
    )
    return setup if settings.shape is None else setup.fitted(_shape(settings.shape, settings.hand))


def prepared(
    settings: TrackingSettings, report: Report | None = None, cancelled: Cancel | None = None
) -> Path:
    """Build what ``tracking_setup`` needs besides pictures, where it is not there yet; the folder it is in.

    Raises BadInput, Cancelled."""
    hand = _hand(settings)
    prepared_tracker(settings.folder, hand=hand, entries=settings.entries, report=report, cancelled=cancelled)
    glove_colours(settings.folder, hand)
    return settings.folder


def _hand(settings: TrackingSettings) -> PrintedHand:
    """The hand to be tracked, by its sizes."""
    sizes = HandDimensions.from_measured(settings.sizes_mm)
    skin = hand_skin(hand_skeleton(sizes, "left" if settings.hand == "left" else "right"))
    return PrintedHand(skin, printed_pattern())


def _shape(file: Path, hand: str) -> HandShape:
    shape = read_shape(file)
    if shape.hand != hand:
        raise BadInput(f"{file} is of a {shape.hand} hand; the {hand} one wears the glove")
    return shape


def _size(source: PictureSource) -> tuple[int, int]:
    """Width and height of its pictures."""
    source.open()
    try:
        height, width = source.read().pixels.shape[:2]
        return width, height
    finally:
        source.close()


LONGEST_SIDE_PX = 640
"""Larger pictures are averaged down, with their camera: the filter, the joining of areas, the least glove
count pixels, and were set at 640 x 480; a window around a hand has 192 x 192 points."""


def working_size(width: int, height: int) -> tuple[int, int]:
    """Width and height at which a picture of this size is looked at."""
    share = min(1.0, LONGEST_SIDE_PX / max(width, height))
    return max(1, round(width * share)), max(1, round(height * share))


def at_working_size(pixels: np.ndarray, *, mirrored: bool = False) -> np.ndarray:
    """A picture (H, W, 3), each pixel the mean of what it covers, or labels (H, W), where it is larger.

    ``mirrored``: left and right were exchanged and are put back.
    """
    height, width = pixels.shape[:2]
    size = working_size(width, height)
    if size != (width, height):
        how = cv2.INTER_AREA if pixels.ndim == 3 else cv2.INTER_NEAREST_EXACT
        pixels = cv2.resize(pixels, size, interpolation=how)
    return np.ascontiguousarray(pixels[:, ::-1]) if mirrored else pixels


def assumed_camera(width: int, height: int) -> Camera:
    """The view of the camera assumed along the longer side of a picture of this size."""
    focal = ASSUMED.focal_px[0] * max(width, height) / ASSUMED.width
    return Camera(width, height, (focal, focal), ((width - 1) / 2, (height - 1) / 2))


def _cameras(
    settings: TrackingSettings, sources: Sequence[PictureSource], sizes: Sequence[tuple[int, int]]
) -> tuple[Camera, ...]:
    """The calibrated ones, else the one assumed, at the size at which pictures are looked at."""
    if settings.calibration is None:
        if len(sizes) > 1:
            raise BadInput(
                "two cameras are tracked together only with their calibration; "
                "glovecal camera calibrate --second tells where the second one stands"
            )
        return (assumed_camera(*working_size(*sizes[0])),)
    cameras = read_cameras(settings.calibration)
    if len(cameras) < len(sources):
        raise BadInput(
            f"{settings.calibration} holds {len(cameras)} camera, {len(sources)} are to be tracked; "
            "glovecal camera calibrate --second calibrates both"
        )
    found = []
    for camera, source, size in zip(cameras, sources, sizes, strict=False):
        looked_at = working_size(camera.width, camera.height)
        # Labels were kept at the size at which the pictures were looked at.
        if size != (camera.width, camera.height) and not (
            isinstance(source, LabelFilePictures) and size == looked_at
        ):
            raise BadInput(
                f"{settings.calibration} is of {camera.width} x {camera.height}, but {source.name} "
                f"gives {size[0]} x {size[1]}: calibrate it at this size"
            )
        found.append(camera.resized(*looked_at))
    return tuple(found)


def glove_colours(folder: Path, hand: PrintedHand) -> ColourTable:
    """Learned from rendered photographs of the printed colours; kept in ``folder``."""
    told = repr((LEARNED, hand.pattern.colour_of_patch.tolist()))
    file = folder / f"colours-{hashlib.sha256(told.encode()).hexdigest()[:20]}.npz"
    if file.exists():
        try:
            return ColourTable.load(file)
        except BadInput:
            file.unlink()
    table = drawn_table(hand.skin, hand.pattern)
    unfinished = file.with_suffix(f".{os.getpid()}")
    table.save(unfinished)
    move_over(unfinished, file)
    return table


# Sources of pictures for a camera glove: those of the recording tool, label images, and a drawn glove.


RENDERED = "rendered"


def camera_source(text: str, glove: Callable[[], RenderedGlove]) -> PictureSource:
    """The source written as ``text``, not yet opened; ``glove`` is drawn for ``rendered``.

    Raises BadOption; DeviceError without OpenCV.
    """
    kind, _, argument = text.partition(":")
    if text == RENDERED:
        return RenderedPictures(glove().draw, RATE_HZ, name=RENDERED)
    if kind == "labels" and argument:
        return LabelFilePictures(Path(argument))
    try:
        return build_source(text)
    except BadOption as error:
        raise BadOption(f"{error}, or labels:FILE") from error


# A glove that opens and closes and turns before a camera that is not there: every picture is drawn.
#
# For trying the chain and the studio without a camera. The motion repeats, and each picture of a round is
# drawn
# once: then drawing takes no time from tracking.


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


BALANCED_ON, APART_S = 4, 0.3
"""Pictures from which the light's gains are told, and how far apart they are at least."""


class CameraLight:
    """``gains`` are those of the light as it was told last; ones before."""

    def __init__(self) -> None:
        self.gains = Gains()
        self._in_this_light: ColourTable | None = None
        self._of_glove: deque[np.ndarray] = deque(maxlen=BALANCED_ON)
        self._of_glove_s = 0.0

    def labels(self, pixels: np.ndarray, setup: TrackingSetup) -> np.ndarray:
        """Of a picture (H, W, 3); one that is labels already (H, W) comes back as it is."""
        if pixels.ndim == 2:
            return pixels
        now = time.monotonic()
        if now - self._of_glove_s >= APART_S:
            self._of_glove_s = now
            self._of_glove.append(pixels)
        if self._in_this_light is not None:
            return self._in_this_light.labels(pixels)
        return setup.colours.labels(self.gains.corrected(pixels))

    def balance(self, setup: TrackingSetup, *, own_colours: bool) -> dict[str, float]:
        """Gains from the last pictures, with the mean distance of labels to the hand's before and after,
        px squared. ``own_colours``: the table is from pictures and cannot be drawn in another light.

        Raises BadInput.
        """
        gains, distance, before = blind_gains(list(self._of_glove), setup.colours, setup.first.lookup)
        self.gains, self._in_this_light = gains, None
        if not own_colours:
            cast = (1.0 / gains.red, 1.0 / gains.green, 1.0 / gains.blue)
            self._in_this_light = drawn_colours(setup.hand.skin, setup.hand.pattern, gains=cast)
        return {**asdict(gains), "distance_px2": distance, "distance_before_px2": before}
