"""``glovecal record``: a take from the live glove."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Annotated

import typer

from glovecal_service.cli.terminal.connection import connect
from glovecal_service.cli.terminal.options import AsJson, Glove, subject_named
from glovecal_service.cli.terminal.printing import err, out, print_json
from glovecal_service.cli.terminal.refusal import NobodyThere
from glovecal_service.cli.terminal.waiting import wait_seconds

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
    as_json: AsJson = False,
) -> None:
    """Record a take from a glove that is streaming to the service. Ctrl-C stops it early."""
    wanted = {"glove": glove, "name": name, "subject": subject, "wearing": wearing, "lead_s": pre_roll}
    with connect() as service:
        started = service.post(
            "/recordings", {key: value for key, value in wanted.items() if value is not None}
        )
        try:
            _wait_for_the_recorder(service, started["id"], glove)
            err.print(f"Recording {name} for {seconds:g} s; Ctrl-C stops early.")
            wait_seconds(seconds, f"recording {name}", quiet=as_json)
        except KeyboardInterrupt:
            err.print("Stopped.")
        except SystemExit:
            service.post(f"/recordings/{started['id']}/stop")
            raise
        finished = service.finish_recording(started["id"])
    if as_json:
        print_json(finished)
        return
    facts = finished["facts"]
    if "take" in facts:
        out.print(
            f"Take {facts['take'][:12]}: {facts['recorded']} of {facts['sent']} frames sent, "
            f"{facts['repaired']} fetched from the capture log, {facts['missing_frames']} missing."
        )
    if finished["state"] == "repairing":
        err.print(
            f"Recording {finished['id']} is {facts['sentence']}. It completes as soon as capture answers; "
            "glovecal take list shows its state.",
            style="yellow",
        )
    if pre_roll and "take" in facts:
        out.print(f"Pre-roll: {facts['pre_roll']['sentence']}.")


def _wait_for_the_recorder(service: RestClient, recording: str, glove: str) -> None:
    """Raises NobodyThere when no recorder takes it on: then nothing would be recorded."""
    until = time.monotonic() + BEGINS_WITHIN_S
    while service.get(f"/recordings/{recording}")["state"] == "requested":
        if time.monotonic() > until:
            service.post(f"/recordings/{recording}/stop")
            raise NobodyThere(
                f"recording {recording} of glove {glove} did not start within {BEGINS_WITHIN_S:g} s; is "
                "glovecal serve running on this data folder?"
            )
        time.sleep(0.05)
