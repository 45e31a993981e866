"""``glovecal record``: a take from the live glove."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Annotated, Any

import typer

from glovecal_service.cli.glove.beside import finish_video, video_beside, warn_of_cold_gloves
from glovecal_service.cli.terminal.connection import connect
from glovecal_service.cli.terminal.options import AsJson, Glove, subject_named
from glovecal_service.cli.terminal.printing import NobodyThere, err, out, print_json
from glovecal_service.cli.terminal.waiting import wait_seconds
from glovecal_service.plain import read
from glovecal_service.rest.glove.answer import Recording

if TYPE_CHECKING:
    from glovecal_client.rest import RestClient

BEGINS_WITHIN_S = 10.0


def record(
    glove: Glove,
    name: Annotated[str, typer.Argument(help="Name of the take.")],
    seconds: Annotated[float, typer.Option(min=0.1, help="Duration in seconds.")] = 10.0,
    subject: Annotated[
        str | None,
        typer.Option("--subject", "-s", help="Default: the wearer of the glove.", callback=subject_named),
    ] = None,
    wearing: Annotated[str | None, typer.Option(help="Default: the glove's wearing.")] = None,
    pre_roll: Annotated[
        float,
        typer.Option(
            min=0,
            max=600,
            help="Pre-roll: seconds before the take to fetch from the capture log, for effects with memory.",
        ),
    ] = 60.0,
    both: Annotated[
        str | None, typer.Option("--with", metavar="GLOVE", help="The other hand, recorded at the same time.")
    ] = None,
    video: Annotated[
        str | None, typer.Option(help="Film it: camera:0, or rendered to try; into this folder.")
    ] = None,
    warm_up: Annotated[bool, typer.Option("--warm-up", help="Wait until the gloves are warm.")] = False,
    as_json: AsJson = False,
) -> None:
    """Record a take from a glove that is streaming to the service, or both hands. Ctrl-C stops it early."""
    if both is not None and subject is not None:
        raise typer.BadParameter("with two gloves the wearers are those of the gloves; leave --subject out")
    gloves = [glove] if both is None else [glove, both]
    wanted = {"name": name, "subject": subject, "wearing": wearing, "lead_s": pre_roll}
    with connect() as service:
        warn_of_cold_gloves(service, gloves, wait=warm_up)
        with video_beside(video, name) as film:
            started = start_takes(service, gloves, wanted)
            try:
                err.print(f"Recording {name} for {seconds:g} s; Ctrl-C stops early.")
                wait_seconds(seconds, f"recording {name}", quiet=as_json)
            except KeyboardInterrupt:
                err.print("Stopped.")
            except SystemExit:
                _stop(service, started)
                raise
            finished = finish_takes(service, started)
            if film is not None:
                finish_video(service, film, finished)
    if as_json:
        documents = [one.model_dump(mode="json") for one in finished]
        print_json(documents[0] if both is None else documents)
        return
    for one in finished:
        _tell(one, told_pre_roll=bool(pre_roll))


def start_takes(service: RestClient, gloves: Sequence[str], wanted: Mapping[str, Any]) -> list[Recording]:
    """Ask for a recording of each glove and wait until all go on. Raises NobodyThere; then none goes on."""
    known = {key: value for key, value in wanted.items() if value is not None}
    started: list[Recording] = []
    try:
        for glove in gloves:
            started.append(read(Recording, service.post("/recordings", {"glove": glove, **known})))
        for one in started:
            _wait_for_the_recorder(service, one)
    except BaseException:
        _stop(service, started)
        raise
    return started


def finish_takes(service: RestClient, started: Sequence[Recording]) -> list[Recording]:
    """Stop all, then wait for their accounts."""
    _stop(service, started)
    return [read(Recording, service.finish_recording(one.id)) for one in started]


def _stop(service: RestClient, started: Sequence[Recording]) -> None:
    for one in started:
        service.post(f"/recordings/{one.id}/stop")


def _tell(finished: Recording, *, told_pre_roll: bool) -> None:
    account = finished.account
    if account.take is not None:
        out.print(
            f"Take {account.take[:12]}: {account.recorded} of {account.sent} frames sent, "
            f"{account.repaired} fetched from the capture log, {account.missing_frames} missing."
        )
    if finished.state == "repairing":
        err.print(
            f"Recording {finished.id}: {account.sentence}. What is open is settled as soon as capture "
            "answers.",
            style="yellow",
        )
    if told_pre_roll and account.take is not None:
        out.print(f"Pre-roll: {account.pre_roll.sentence}.")


def _wait_for_the_recorder(service: RestClient, one: Recording) -> None:
    """Raises NobodyThere when no recorder takes it on: then nothing would be recorded."""
    until = time.monotonic() + BEGINS_WITHIN_S
    while read(Recording, service.get(f"/recordings/{one.id}")).state == "requested":
        if time.monotonic() > until:
            raise NobodyThere(
                f"recording {one.id} of glove {one.glove} did not start within {BEGINS_WITHIN_S:g} s; is "
                "glovecal serve running on this data folder?"
            )
        time.sleep(0.05)
