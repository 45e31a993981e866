"""A camera as a process of its own: ``python -m glovecal_service.camera.process SETTINGS``.

A camera's driver may hang or crash, and then only this does. It goes on until its standard input ends, which
is also when the program that started it dies.
"""

from __future__ import annotations

import sys
import threading
from typing import TYPE_CHECKING

from glovecal_client.capture.command import tell
from glovecal_client.errors import ClientError, DeviceError
from glovecal_client.private_files import keep_private
from glovecal_client.program import guard_streams, leave_at_once
from glovecal_models.errors import GlovecalError
from glovecal_models.worker_processes import pin_blas_to_one_thread
from glovecal_service.camera.camera_settings import CameraSettings, camera_not_installed
from glovecal_service.child_process import stopped_with_the_service
from glovecal_service.plain import reason_of

if TYPE_CHECKING:
    from glovecal_service.camera.camera_tracking import CameraSummary

GIL_SWITCH_S = 0.0005
"""Longest time that tracking keeps the thread waiting that stamps pictures."""


def run_camera(settings: CameraSettings, stop: threading.Event) -> CameraSummary:
    """Until ``stop`` is set or a file is over. Raises BadInput, DeviceError, CaptureRefused."""
    try:
        from glovecal_service.camera.camera_tracking import CameraTracking
    except ModuleNotFoundError as error:
        raise DeviceError(camera_not_installed("a camera")) from error
    keep_private()
    pin_blas_to_one_thread()
    sys.setswitchinterval(GIL_SWITCH_S)
    return CameraTracking(settings, tell).run(stop)


def main(text: str) -> int:
    """0, or 1 with a sentence on standard error."""
    try:
        with stopped_with_the_service() as stop:
            tell(str(run_camera(CameraSettings.from_text(text), stop)))
    except (GlovecalError, ClientError, OSError) as error:
        tell(reason_of(error))
        return 1
    return 0


if __name__ == "__main__":
    guard_streams()
    leave_at_once(main(*sys.argv[1:]))  # all is closed; a driver's thread may hang
