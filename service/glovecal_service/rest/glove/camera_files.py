"""``camera-files``: colour tables and calibrations that cameras are started with, by names."""

from __future__ import annotations

from fastapi import APIRouter
from pydantic import Field

from glovecal_service.camera.camera_settings import CameraFiles, Kind
from glovecal_service.request_types import Sha256, StrictBody
from glovecal_service.rest.glove.answer import CameraFileNames
from glovecal_service.rest.http.dependencies import Parts, PartsNeeded
from glovecal_service.rest.http.problem import change_problems, problems
from glovecal_service.rest.http.request_types import NameInPath
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


@router.put(
    "/{kind}/{name}",
    response_model=CameraFileNames,
    summary="Keep a colour table or calibration",
    responses=change_problems(),
)
def put_camera_file(kind: Kind, name: NameInPath, body: NewCameraFile, parts: PartsNeeded) -> CameraFileNames:
    """One of that name is replaced; cameras that are on go on with theirs. What is no such file changes
    nothing."""
    upload = parts.uploads.find(body.upload)
    if upload is None:
        raise NotFound(f"no upload {body.upload[:12]}; send the file to /v1/uploads first")
    with parts.uploads.under_names((upload.name, upload)) as [file]:
        _files(parts).keep(kind, name, file)
    return list_camera_files(parts)


def _files(parts: Parts) -> CameraFiles:
    return CameraFiles(parts.settings.data / "cameras")
