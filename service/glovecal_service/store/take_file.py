"""A take as one file (safetensors, JSON in its metadata), and the preview of a video filmed beside it."""

from __future__ import annotations

import hashlib
import json
import shutil
import zipfile
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, ValidationError
from safetensors import SafetensorError
from safetensors.numpy import load as load_arrays
from safetensors.numpy import save as save_arrays

from glovecal_client.encryption.kept_file import create_whole, open_kept
from glovecal_client.operating_system import move_over
from glovecal_client.pictures.video_file import ABOUT, MOST_PICTURES, picture_name
from glovecal_models.documents import UNREADABLE_ARCHIVE, read_json
from glovecal_models.errors import BadInput, DamagedArtifact
from glovecal_models.takes.take import Take
from glovecal_service.store.errors import NotFound
from glovecal_service.store.shared_files import SharedFiles

VERSION = 1


def dump_take(take: Take) -> bytes:
    """The take as bytes; ``load_take`` gives it back, every number bit for bit."""
    arrays: dict[str, np.ndarray] = {
        "time_s": np.asarray(take.time_s, np.float64),
        "readings": np.asarray(take.readings, np.float64),
        "reference_time_s": np.asarray(take.reference_time_s, np.float64),
        "reference": np.asarray(take.reference, np.float64),
        **{f"context.{name}": np.asarray(column, np.float64) for name, column in take.context.items()},
    }
    if take.reference_sd is not None:  # absent in takes stored before: those read as they did
        arrays["reference_sd"] = np.asarray(take.reference_sd, np.float64)
    description: dict[str, Any] = {
        "version": VERSION,
        "name": take.name,
        "wearing": take.wearing,
        "sensors": list(take.sensors),
        "rotations": list(take.rotations),
        "context": list(take.context),
        "simulated": take.simulated,
        "poses": None,
        **({} if take.begins_s is None else {"begins_s": take.begins_s}),
    }
    if take.poses is not None:
        numbers = {pose: number for number, pose in enumerate(dict.fromkeys(take.poses))}
        description["poses"] = list(numbers)
        arrays["poses"] = np.array([numbers[pose] for pose in take.poses], np.int32)
    contiguous = {name: np.ascontiguousarray(array) for name, array in arrays.items()}
    return save_arrays(contiguous, {"glovecal.take": json.dumps(description)})


def load_take(content: bytes) -> Take:
    """Inverse of ``dump_take``. Raises DamagedArtifact if the bytes are no take."""
    try:
        arrays, description = load_arrays(content), _description(content)
        if description["version"] != VERSION:
            raise DamagedArtifact(
                f"take file has version {description['version']}, this software reads {VERSION}"
            )
        poses = description["poses"]
        if poses is not None:
            poses = tuple(poses[number] for number in arrays["poses"])
        return Take(
            name=description["name"],
            wearing=description["wearing"],
            sensors=tuple(description["sensors"]),
            time_s=arrays["time_s"],
            readings=arrays["readings"],
            rotations=tuple(description["rotations"]),
            reference_time_s=arrays["reference_time_s"],
            reference=arrays["reference"],
            reference_sd=arrays.get("reference_sd"),
            context={name: arrays[f"context.{name}"] for name in description["context"]},
            poses=poses,
            simulated=bool(description["simulated"]),
            begins_s=description.get("begins_s"),
        )
    except (SafetensorError, KeyError, IndexError, TypeError, ValueError) as error:
        raise DamagedArtifact("these bytes are no take file, or were damaged") from error


def frames_hash(take: Take) -> str:
    """sha256 hex of what the glove sent (sensor names, times, readings), whatever the take is called."""
    digest = hashlib.sha256(json.dumps(list(take.sensors)).encode())
    for array in (take.time_s, take.readings):
        digest.update(np.ascontiguousarray(array, np.float64).tobytes())
    return digest.hexdigest()


def _description(content: bytes) -> dict[str, Any]:
    header = json.loads(content[8 : 8 + int.from_bytes(content[:8], "little")])
    return json.loads(header["__metadata__"]["glovecal.take"])


LARGEST_PICTURE = 1_000_000
LARGEST_ABOUT = 2_000_000
MADE_BY = "one is made by glovecal record GLOVE NAME --video SOURCE"
JPEG_BEGINS = b"\xff\xd8\xff"
Line = Annotated[str, Field(max_length=300)]


class VideoFacts(BaseModel):
    """What a preview is of."""

    model_config = ConfigDict(extra="ignore")

    source: Line
    simulated: bool = Field(description="Its pictures were drawn, not taken.")
    computer: Annotated[str, Field(max_length=64)]
    times_s: Annotated[list[FiniteFloat], Field(min_length=1, max_length=MOST_PICTURES)] = Field(
        description="Of each picture, seconds of the computer's monotonic clock: the clock of its takes."
    )


class Videos:
    """The folder ``videos`` of the data folder, and what other services have of it."""

    def __init__(self, files: SharedFiles) -> None:
        self._files = files

    def attach(self, take: str, preview: Path) -> VideoFacts:
        """Keep ``preview`` for a take's id, in place of an earlier one. Raises BadInput."""
        facts = check_preview(preview)
        path = self._files.data / video_of(take)
        path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        partial = path.with_suffix(".partial")
        partial.unlink(missing_ok=True)
        with open_kept(preview) as file, create_whole(partial) as kept:
            shutil.copyfileobj(file, kept)
        move_over(partial, path)
        self._files.note_written(video_of(take))
        return facts

    def takes(self) -> list[str]:
        """Ids of takes that have a video."""
        return [Path(file).stem for file in self._files.names("videos/") if file.endswith(".zip")]

    def facts(self, take: str) -> VideoFacts:
        """Raises NotFound, BadInput for a file that was damaged since."""
        return _facts(self._found(take))

    def picture(self, take: str, number: int) -> bytes:
        """One JPEG picture. Raises NotFound, BadInput."""
        try:
            with open_kept(self._found(take)) as content, zipfile.ZipFile(content) as file:
                return file.read(picture_name(number))
        except KeyError as error:
            raise NotFound(f"the video of take {take} has no picture {number}") from error
        except UNREADABLE_ARCHIVE as error:
            raise BadInput(f"the video of take {take} is damaged; attach it again") from error

    def _found(self, take: str) -> Path:
        path = self._files.find(video_of(take))
        if path is None:
            raise NotFound(f"take {take} has no video; glovecal take video attaches one")
        return path


def video_of(take: str) -> str:
    """Its path below the data folder."""
    return f"videos/{take}.zip"


def check_preview(path: Path) -> VideoFacts:
    """Every entry of the file. Raises BadInput that says what is wrong."""
    facts = _facts(path)
    if not (np.diff(facts.times_s) > 0).all():
        raise BadInput("times_s of the video's pictures must increase")
    with open_kept(path) as content, zipfile.ZipFile(content) as file:
        wanted = {picture_name(number) for number in range(len(facts.times_s))} | {ABOUT}
        entries = {entry.filename: entry for entry in file.infolist()}
        if set(entries) != wanted or len(entries) != len(file.infolist()):
            raise BadInput(f"the video must hold {ABOUT} and {len(wanted) - 1} pictures, one a time")
        for name, entry in entries.items():
            if entry.compress_type != zipfile.ZIP_STORED:
                raise BadInput(f"{name} in the video is compressed; pictures are stored as they are")
            if name == ABOUT:
                continue
            if entry.file_size > LARGEST_PICTURE:
                raise BadInput(f"{name} has {entry.file_size} bytes; at most {LARGEST_PICTURE}")
            try:
                begins = file.open(entry).read(len(JPEG_BEGINS))
            except UNREADABLE_ARCHIVE as error:
                raise BadInput(
                    f"{name} in the video cannot be read: it is encrypted or damaged; {MADE_BY}"
                ) from error
            if begins != JPEG_BEGINS:
                raise BadInput(f"{name} in the video is no JPEG picture")
    return facts


def _facts(path: Path) -> VideoFacts:
    try:
        with open_kept(path) as content, zipfile.ZipFile(content) as file:
            entry = file.getinfo(ABOUT)
            if entry.file_size > LARGEST_ABOUT:
                raise BadInput(f"{ABOUT} has {entry.file_size} bytes; at most {LARGEST_ABOUT}")
            return VideoFacts.model_validate(read_json(file.read(entry), f"{ABOUT} of the video"))
    except ValidationError as error:
        where = ".".join(map(str, error.errors()[0]["loc"]))
        raise BadInput(f"{ABOUT} of the video: {where} is not what it should be; {MADE_BY}") from error
    except BadInput:
        raise
    except UNREADABLE_ARCHIVE as error:
        raise BadInput(
            f"no preview of a video: the file is no zip file with {ABOUT}, encrypted or damaged; {MADE_BY}"
        ) from error
