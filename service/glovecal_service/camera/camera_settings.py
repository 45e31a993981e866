"""What pictures are tracked with and a camera is started with: settings, packages, files kept by name."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Literal, get_args

from glovecal_client.encryption.kept_file import create_whole, finish_file
from glovecal_client.errors import BadName, DeviceError
from glovecal_client.installation import not_installed, packages_of
from glovecal_client.keys import GloveKeys
from glovecal_client.operating_system import move_over
from glovecal_client.pictures.video_file import SUFFIXES, VideoFilePictures, times_path, write_times
from glovecal_client.private_files import PRIVATE_FOLDER
from glovecal_models.colour_glove.hand_state import STAGES
from glovecal_models.errors import BadInput
from glovecal_models.names import check_identifier
from glovecal_service.store.errors import NotFound

Keep = Literal["pictures", "labels", "nothing"]
KEEPS: tuple[Keep, ...] = get_args(Keep)
DEFAULT_KEEP: Keep = "labels"
"""Half a gigabyte an hour in place of tens, can be tracked again at any stage, and shows no face."""
DEFAULT_STAGE = "dense"
HANDS = ("right", "left")


@dataclass(frozen=True, kw_only=True)
class TrackingSettings:
    """What a hand is tracked with, live or in recordings. Raises BadInput for what is none of the known."""

    data: Path
    hand: str = "right"
    stage: str = DEFAULT_STAGE
    colours: Path | None = None
    """Colour table; None: one that is learned on rendered photographs of the printed colours."""
    calibration: Path | None = None
    """Each camera's focal length, centre and distortion, and where the second stands; None: those of an
    assumed camera, which is said."""
    entries: int = 20_000
    """Of the pose database."""
    sizes_mm: Mapping[str, float] = field(default_factory=dict)
    """Of the subject's hand, as measured; what is missing follows from them, or is assumed."""
    shape: Path | None = None
    """Of the hand in its glove, as ``glovecal camera shape`` finds it; None: by ``sizes_mm``."""
    mirrored: bool = False
    """Whether left and right of the pictures are exchanged, as a preview's often are."""

    def __post_init__(self) -> None:
        _require("stage", self.stage, STAGES)
        _require("hand", self.hand, HANDS)

    @property
    def folder(self) -> Path:
        """Of everything that cameras keep."""
        return self.data / "cameras"


@dataclass(frozen=True)
class CameraSettings(TrackingSettings):
    """Raises BadInput for what no camera can be started with."""

    source: str
    """``camera:0``, ``video:FILE.mkv``, ``labels:FILE.labels`` or ``rendered``."""
    glove: str
    """Under which its poses are published."""
    site: str = "lab"
    zenoh: str = "tcp/127.0.0.1:7447"
    subject: str | None = None
    keep: Keep = DEFAULT_KEEP

    def __post_init__(self) -> None:
        super().__post_init__()
        try:
            GloveKeys(self.site, self.glove)
        except BadName as error:
            raise BadInput(str(error)) from error
        _require("keep", self.keep, KEEPS)

    @property
    def keys(self) -> GloveKeys:
        return GloveKeys(self.site, self.glove)

    def text(self) -> str:
        """As JSON, for a process of its own."""
        return json.dumps(asdict(self), default=str)

    @classmethod
    def from_text(cls, text: str) -> CameraSettings:
        """From what ``text`` gave."""
        given: dict[str, Any] = json.loads(text)
        for name in ("data", "colours", "calibration", "shape"):
            given[name] = None if given[name] is None else Path(given[name])
        return cls(**given)


def _require(name: str, value: str, known: Sequence[str]) -> None:
    if value not in known:
        raise BadInput(f"{name} {value!r} is none of {', '.join(known)}")


def camera_not_installed(what: str) -> str:
    """The sentence that packages are missing which ``what`` needs, with the command that installs them."""
    return not_installed(what, *packages_of("glovecal-models", "camera"))


Kind = Literal["colours", "calibrations"]
KINDS: tuple[Kind, ...] = get_args(Kind)
_SUFFIX = {"colours": ".npz", "calibrations": ".json"}
_MADE_BY = {"colours": "glovecal camera colours", "calibrations": "glovecal camera calibrate"}
LARGEST_FILE = 1 << 20


@dataclass(frozen=True)
class KeptVideo:
    """A video that was imported."""

    name: str
    file: Path
    pictures: int
    seconds: float
    """From its first picture to its last."""
    times: str
    """Where the times of its pictures come from, and how even they are."""


class CameraFiles:
    """Those of one data folder: ``cameras/colours``, ``cameras/calibrations`` and ``cameras/videos``."""

    def __init__(self, cameras: Path) -> None:
        self._cameras = cameras

    def names(self, kind: Kind) -> list[str]:
        return sorted(file.stem for file in (self._cameras / kind).glob(f"*{_SUFFIX[kind]}"))

    def path(self, kind: Kind, name: str) -> Path:
        """Raises NotFound that says which there are, BadInput for what is no name."""
        file = self._place(kind, name)
        if not file.is_file():
            known = ", ".join(self.names(kind)) or "none yet"
            raise NotFound(f"no {kind} {name!r}; there are: {known}. {_MADE_BY[kind]} makes them")
        return file

    def keep(self, kind: Kind, name: str, file: Path) -> Path:
        """A copy of ``file`` under ``name``, in place of one that is there. Raises BadInput for a file that
        holds something else: nothing is changed then."""
        place = self._place(kind, name)
        if file.stat().st_size > LARGEST_FILE:
            raise BadInput(
                f"{file.name} is larger than {LARGEST_FILE} bytes: neither colour table nor calibration"
            )
        _check(kind, file)
        place.parent.mkdir(mode=PRIVATE_FOLDER, parents=True, exist_ok=True)
        unfinished = place.with_name(f".{place.name}.{os.getpid()}")
        try:
            shutil.copyfile(file, unfinished)
            move_over(unfinished, place)
        finally:
            unfinished.unlink(missing_ok=True)
        return place

    def videos(self) -> list[KeptVideo]:
        """By name."""
        files = sorted((self._cameras / _VIDEOS).glob("*"))
        return [_described(file) for file in files if file.suffix in SUFFIXES and times_path(file).exists()]

    def video(self, name: str) -> KeptVideo:
        """Raises NotFound that says which there are."""
        for each in (known := self.videos()):
            if each.name == name:
                return each
        there_are = ", ".join(each.name for each in known) or "none yet"
        raise NotFound(
            f"no video {name!r}; there are: {there_are}. To bring one here: glovecal camera import FILE"
        )

    def keep_video(self, name: str, file: Path) -> KeptVideo:
        """A copy of a phone's or a camera's video, in place of one of that name, encrypted where files are,
        with the times of its pictures beside it. Raises BadInput for a file that is none: nothing is changed
        then."""
        suffix = file.suffix.lower()
        if suffix not in SUFFIXES:
            raise BadInput(f"{file.name} is no video that can be read: {', '.join(SUFFIXES)}")
        try:
            stamps = VideoFilePictures(file).stamps
        except DeviceError as error:
            raise BadInput(str(error)) from error
        place = self._cameras / _VIDEOS / (check_identifier(name, "name") + suffix)
        place.parent.mkdir(mode=PRIVATE_FOLDER, parents=True, exist_ok=True)
        unfinished = place.with_name(f".{place.name}.{os.getpid()}")
        try:
            with file.open("rb") as source, create_whole(unfinished) as kept:
                shutil.copyfileobj(source, kept)
                finish_file(kept)
            for before in (place.with_suffix(other) for other in SUFFIXES):
                before.unlink(missing_ok=True)
            move_over(unfinished, place)
        finally:
            unfinished.unlink(missing_ok=True)
        about = {"video": file.name, "pictures": len(stamps.times_ns), "times": stamps.sentence}
        place.with_suffix(".json").write_text(json.dumps(about, indent=1) + "\n", encoding="utf-8")
        write_times(place, stamps.times_ns)
        return _described(place)

    def _place(self, kind: Kind, name: str) -> Path:
        return self._cameras / kind / (check_identifier(name, "name") + _SUFFIX[kind])


_VIDEOS = "videos"


def _described(file: Path) -> KeptVideo:
    stamps = VideoFilePictures(file).stamps
    first, last = stamps.times_ns[0][0], stamps.times_ns[-1][0]
    return KeptVideo(file.stem, file, len(stamps.times_ns), (last - first) / 1e9, stamps.sentence)


def _check(kind: Kind, file: Path) -> None:
    try:
        from glovecal_models.colour_glove.camera_model import read_cameras
        from glovecal_models.colour_glove.pictures.classify import ColourTable
    except ModuleNotFoundError as error:
        raise BadInput(camera_not_installed("a camera's file")) from error
    if kind == "colours":
        ColourTable.load(file)
    else:
        read_cameras(file)
