"""Pictures of a webcam, as the operating system numbers them."""

from __future__ import annotations

from typing import Any

from glovecal_client.errors import DeviceLost
from glovecal_client.pictures.source import Picture, opencv

USUAL_HZ = 30.0


class CameraPictures:
    """Through OpenCV, at the size and rate that the camera chooses."""

    simulated = False

    def __init__(self, number: int) -> None:
        self.name: str = f"camera:{number}"
        self.rate_hz = USUAL_HZ
        self._number = number
        self._cv2 = opencv()
        self._camera: Any = None

    def open(self) -> None:
        self.close()
        camera = self._cv2.VideoCapture(self._number)
        if not camera.isOpened():
            camera.release()
            raise DeviceLost(f"{self.name} cannot be opened: is it plugged in, and free of other programs?")
        camera.set(self._cv2.CAP_PROP_BUFFERSIZE, 1)  # an old picture would have a new time stamp
        said = camera.get(self._cv2.CAP_PROP_FPS)
        self.rate_hz: float = said if 1 <= said <= 1000 else USUAL_HZ
        self._camera = camera

    def read(self) -> Picture:
        if self._camera is None:
            raise DeviceLost(f"{self.name} is not open")
        is_there, pixels = self._camera.read()
        if not is_there:
            raise DeviceLost(f"{self.name} gives no picture any more")
        return Picture.now(pixels)

    def close(self) -> None:
        camera, self._camera = self._camera, None
        if camera is not None:
            camera.release()
