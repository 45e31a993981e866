"""What goes on beside a recording: a video of the hand, and whether the glove is warm."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from glovecal_client.errors import ClientError, ServiceError
from glovecal_models.documents import read_json
from glovecal_models.errors import BadInput
from glovecal_service.cli.terminal.printing import err
from glovecal_service.cli.terminal.waiting import wait_seconds
from glovecal_service.plain import read
from glovecal_service.rest.glove.answer import LiveGlove, Recording
from glovecal_service.rest.take.answer import Video

if TYPE_CHECKING:
    from glovecal_client.pictures.recording import VideoRecording
    from glovecal_client.rest import RestClient


@contextmanager
def video_beside(source: str | None, name: str) -> Iterator[VideoRecording | None]:
    """Pictures of ``source`` into ``NAME.mkv`` in this folder; nothing for None. Raises DeviceError."""
    if source is None:
        yield None
        return
    from glovecal_client.pictures.recording import VideoRecording
    from glovecal_client.pictures.source import build_source

    with VideoRecording(build_source(source), Path(f"{name}.mkv")) as video:
        yield video
    if video.problem:
        err.print(f"The video ended after {video.pictures} pictures: {video.problem}", style="yellow")


def finish_video(service: RestClient, video: VideoRecording, finished: Sequence[Recording]) -> None:
    """End it, write what it is of, and show it beside the takes of the recordings that ``finished``."""
    takes = [one.account.take for one in finished]
    about = video.describe(takes=takes)
    err.print(f"Video: {video.pictures} pictures, described in {about}.")
    if video.pictures:
        try:
            attach_video(service, about.with_suffix(".mkv"), [take for take in takes if take])
        except ClientError as error:
            err.print(f"It stays here and is not shown in the studio: {error}", style="yellow")


def attach_video(service: RestClient, video: Path, takes: Sequence[str]) -> None:
    """A small copy of it to each take's id. Raises DeviceError, BadInput (its description), ServiceError."""
    from glovecal_client.pictures.video_file import write_preview

    described = video.with_suffix(".json")
    try:
        about = read_json(described.read_bytes(), str(described))
        about = {key: about[key] for key in ("source", "simulated", "computer")}
    except (OSError, KeyError, TypeError) as error:
        raise BadInput(f"{described} must describe {video.name}, as glovecal record writes it") from error
    preview = write_preview(video, about)
    try:
        upload = service.upload(preview)
    finally:
        preview.unlink()
    for take in takes:
        answer = read(Video, service.put(f"/videos/{take}", {"upload": upload}))
        err.print(f"Video beside take {answer.name}: {answer.sentence}")


def warn_of_cold_gloves(service: RestClient, gloves: list[str], *, wait: bool) -> None:
    """Say it, and with ``wait`` wait until all are warm. Nothing where real time does not answer."""
    try:
        live = {one.glove: one for one in read(list[LiveGlove], service.get("/live-gloves"))}
    except ServiceError:
        return
    cold = [live[name] for name in gloves if name in live and live[name].warm_up_left_s]
    for one in cold:
        err.print(
            f"{one.glove} has been captured for {(one.on_for_s or 0.0) / 60:.0f} of 20 minutes: its sensors "
            "are not warm yet, and readings will drift.",
            style="yellow",
        )
    longest = max((one.warm_up_left_s or 0.0 for one in cold), default=0.0)
    if wait and longest > 0:
        err.print("Wear the gloves meanwhile; Ctrl-C stops.")
        wait_seconds(longest, "warming up")
