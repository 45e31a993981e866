"""Colour tables and calibrations in the data folder, by names: what a camera is started with over REST."""

from __future__ import annotations

import os
import shutil
from pathlib import Path
from typing import Literal, get_args

from glovecal_client.operating_system import move_over
from glovecal_client.private_files import PRIVATE_FOLDER
from glovecal_models.errors import BadInput
from glovecal_models.names import check_identifier
from glovecal_service.camera.packages import camera_not_installed
from glovecal_service.store.errors import NotFound

Kind = Literal["colours", "calibrations"]
KINDS: tuple[Kind, ...] = get_args(Kind)
_SUFFIX = {"colours": ".npz", "calibrations": ".json"}
_MADE_BY = {"colours": "glovecal camera colours", "calibrations": "glovecal camera calibrate"}
LARGEST_FILE = 1 << 20


class CameraFiles:
    """Those of one data folder: ``cameras/colours`` and ``cameras/calibrations``."""

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

    def _place(self, kind: Kind, name: str) -> Path:
        return self._cameras / kind / (check_identifier(name, "name") + _SUFFIX[kind])


def _check(kind: Kind, file: Path) -> None:
    try:
        from glovecal_models.colour_glove.camera_file import read_cameras
        from glovecal_models.colour_glove.pictures.classify import ColourTable
    except ModuleNotFoundError as error:
        raise BadInput(camera_not_installed("a camera's file")) from error
    if kind == "colours":
        ColourTable.load(file)
    else:
        read_cameras(file)
