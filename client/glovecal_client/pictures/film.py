"""A video recording as a process of its own: ``python -m glovecal_client.pictures.film SOURCE FILE.mkv``.

A camera's driver may hang or crash, and then only this does. It films until its standard input ends, which is
also when the program that started it dies, and leaves ``FILE.json`` beside the video.
"""

from __future__ import annotations

import sys
from pathlib import Path

from glovecal_client.errors import ClientError
from glovecal_client.pictures.recording import VideoRecording
from glovecal_client.pictures.source import build_source
from glovecal_client.signals import leave_signals_to_the_parent
from glovecal_client.standard_streams import run_command


def main(source: str, file: str) -> int:
    """0, or 1 with a sentence on standard error when there is no camera or no place."""
    leave_signals_to_the_parent()
    try:
        with VideoRecording(build_source(source), Path(file)) as video:
            sys.stdin.buffer.read()
        video.describe()
    except (ClientError, OSError) as error:
        print(error, file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    run_command(lambda: main(*sys.argv[1:]))
