"""Videos that OpenCV writes and reads, encrypted on disk: it takes a path to write to, which is a pipe here,
and reads from a stream. Nothing of them lies on the disk as it is.
"""

from __future__ import annotations

import io
import tempfile
import threading
from pathlib import Path
from typing import Any, BinaryIO

from glovecal_client.encryption.kept_file import create_growing, open_kept
from glovecal_client.errors import DamagedFile, DeviceError, reason_of
from glovecal_client.operating_system import named_pipe

_AT_ONCE = 1 << 16


class EncryptedVideo:
    """Encrypts what is written to ``pipe`` into a file, in a thread of its own."""

    def __init__(self, path: Path) -> None:
        """Raises DeviceError where the system has no named pipes, OSError."""
        self._folder = tempfile.TemporaryDirectory(prefix="glovecal-video-")
        self.pipe: Path = Path(self._folder.name, path.name)
        """For one writer."""
        self.problem = ""
        """Why what was written does not reach the disk, "" if it does."""
        try:
            self._end = named_pipe(self.pipe)
        except OSError as error:
            self._folder.cleanup()
            raise DeviceError(
                f"{path} cannot be encrypted while it is written: {reason_of(error)}. Film on Linux or macOS"
            ) from error
        try:
            self._kept = create_growing(path)
        except BaseException:
            self._end.close()
            self._folder.cleanup()
            raise
        self._thread = threading.Thread(target=self._encrypt, name="encrypted video", daemon=True)

    def begin(self) -> None:
        """The writer has opened the pipe, which loses its name: nothing is left of it, whatever ends the
        process."""
        self._folder.cleanup()
        self._thread.start()

    def close(self) -> None:
        """Once the writer has closed it, or never opened it."""
        if self._thread.ident is not None:
            self._thread.join()
        self._end.close()
        self._kept.close()
        self._folder.cleanup()

    def _encrypt(self) -> None:
        while part := self._end.read(_AT_ONCE):  # to its end: a full pipe would hold the writer for ever
            try:
                if not self.problem:
                    self._kept.write(part)
            except OSError as error:
                self.problem: str = reason_of(error)


class VideoStream(io.BufferedIOBase):
    """An encrypted video for OpenCV; one that is damaged ends there."""

    def __init__(self, path: Path) -> None:
        """Raises OSError, DamagedFile, BadEncryptionKey."""
        self._file: BinaryIO = open_kept(path)

    def read(self, size: int | None = -1, /) -> bytes:
        try:
            return self._file.read(-1 if size is None else size)
        except DamagedFile:
            return b""

    def seek(self, offset: int, whence: int = 0, /) -> int:
        return self._file.seek(offset, whence)

    def close(self) -> None:
        self._file.close()
        super().close()


def open_stream(cv2: Any, stream: VideoStream) -> Any:
    """OpenCV's ``VideoCapture`` of it. Raises DeviceError where OpenCV reads no streams."""
    if not hasattr(cv2, "IStreamReader"):
        raise DeviceError(
            f"an encrypted video cannot be read with OpenCV {cv2.__version__}: install "
            "opencv-python-headless 4.12 or newer"
        )
    return cv2.VideoCapture(stream, cv2.CAP_FFMPEG, [])
