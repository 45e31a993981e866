"""``camera-files``: colour tables, calibrations and videos that cameras are started with, by names."""

from __future__ import annotations

from pathlib import Path

from fastapi import APIRouter
from pydantic import Field

from glovecal_service.camera.camera_settings import CameraFiles, KeptVideo, Kind
from glovecal_service.request_types import Sha256, StrictBody
from glovecal_service.rest.glove.answer import CameraFileNames, CameraVideo
from glovecal_service.rest.http.dependencies import Parts, PartsNeeded
from glovecal_service.rest.http.list_part import InParts
from glovecal_service.rest.http.problem import change_problems, problems
from glovecal_service.rest.http.request_types import NameInPath
from glovecal_service.rest.take.uploads import FILE_NAME, LONGEST_FILE_NAME
from glovecal_service.store.errors import NotFound

router = APIRouter(prefix="/camera-files", tags=["cameras"])


class NewCameraFile(StrictBody):
    upload: Sha256 = Field(description="A colour table (.npz) or calibration (.json) sent to `uploads`.")


@router.get(
    "", response_model=CameraFileNames, summary="Colour tables and calibrations", responses=problems()
)
def list_camera_files(parts: PartsNeeded) -> CameraFileNames:
    files = _files(parts)
    return CameraFileNames(colours=files.names("colours"), calibrations=files.names("calibrations"))


class NewCameraVideo(StrictBody):
    upload: Sha256 = Field(description="A video sent to `uploads`.")
    filename: str = Field(
        pattern=FILE_NAME, max_length=LONGEST_FILE_NAME,
        description="As it was called: .mp4, .mov, .m4v, .mkv, .webm or .avi.",
    )  # fmt: skip


@router.get("/videos", response_model=list[CameraVideo], summary="Imported videos", responses=problems())
def list_camera_videos(parts: PartsNeeded, paging: InParts) -> list[CameraVideo]:
    return paging.part_of((_view(video) for video in _files(parts).videos()), lambda view: view.name)


@router.put(
    "/videos/{name}", response_model=CameraVideo, summary="Import a video", responses=change_problems()
)
def put_camera_video(name: NameInPath, body: NewCameraVideo, parts: PartsNeeded) -> CameraVideo:
    """A phone's or a camera's video becomes a source of pictures, `video:NAME`. The times of its pictures are
    the file's own; where it has none, the answer says what is taken for them. One of that name is
    replaced."""
    upload = _upload(parts, body.upload)
    with parts.uploads.under_names((body.filename, upload)) as [file]:
        return _view(_files(parts).keep_video(name, file))


@router.put(
    "/{kind}/{name}",
    response_model=CameraFileNames,
    summary="Keep a colour table or calibration",
    responses=change_problems(),
)
def put_camera_file(kind: Kind, name: NameInPath, body: NewCameraFile, parts: PartsNeeded) -> CameraFileNames:
    """One of that name is replaced; cameras that are on go on with theirs. What is no such file changes
    nothing."""
    upload = _upload(parts, body.upload)
    with parts.uploads.under_names((upload.name, upload)) as [file]:
        _files(parts).keep(kind, name, file)
    return list_camera_files(parts)


def _upload(parts: Parts, sha256: str) -> Path:
    upload = parts.uploads.find(sha256)
    if upload is None:
        raise NotFound(f"no upload {sha256[:12]}; send the file to /v1/uploads first")
    return upload


def _view(video: KeptVideo) -> CameraVideo:
    return CameraVideo(name=video.name, pictures=video.pictures, seconds=video.seconds, times=video.times)


def _files(parts: Parts) -> CameraFiles:
    return CameraFiles(parts.settings.data / "cameras")
