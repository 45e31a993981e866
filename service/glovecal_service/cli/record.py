"""``glovecal record``: a take from the live glove."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Annotated, Any

import typer

from glovecal_client.errors import ServiceError
from glovecal_service.cli.connection import connect
from glovecal_service.cli.options import AsJson
from glovecal_service.cli.printing import err, out, print_json

if TYPE_CHECKING:
    from glovecal_client.rest import RestClient

PATIENCE_S = 30.0


def record(
    glove: Annotated[str, typer.Argument(help="The glove's name.")],
    name: Annotated[str, typer.Argument(help="What the take will be called.")],
    seconds: Annotated[float, typer.Option(help="How long.")] = 10.0,
    as_json: AsJson = False,
) -> None:
    """Record a take from a glove that is streaming to the service at GLOVECAL_URL."""
    with connect() as service:
        started = service.post("/recordings", {"glove": glove, "name": name})
        err.print(f"Recording {name} for {seconds:g} s; Ctrl-C ends it sooner.", markup=False)
        try:
            time.sleep(seconds)
        except KeyboardInterrupt:
            err.print("Stopped.")
        finished = finish_recording(service, started["id"])
    if as_json:
        print_json(finished)
        return
    facts = finished["facts"]
    out.print(
        f"Take {facts['take'][:12]}: {facts['recorded']} of {facts['sent']} frames sent, "
        f"{facts['repaired']} of them fetched again from the capture log, {len(facts['missing'])} gaps left."
    )


def finish_recording(service: RestClient, recording: str) -> dict[str, Any]:
    """Stop a recording and wait for its take. Raises ServiceError when it failed or takes too long."""
    service.post(f"/recordings/{recording}/stop")
    until = time.monotonic() + PATIENCE_S
    while (document := service.get(f"/recordings/{recording}"))["state"] != "done":
        if document["state"] == "failed":
            raise ServiceError(
                409, "Recording failed", document["facts"].get("sentence", "no reason was given")
            )
        if time.monotonic() > until:
            raise ServiceError(
                504,
                "Recording not finished",
                f"recording {recording} is still {document['state']}; is glovecal serve running?",
            )
        time.sleep(0.1)
    return document
