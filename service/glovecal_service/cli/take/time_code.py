"""``glovecal take timecode``: which SMPTE time code a take has, from a sound file (LTC) or entered."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from glovecal_models.takes.time_code import RATES, TimeCode
from glovecal_service.cli.take.rows import named_take
from glovecal_service.cli.terminal.connection import connect
from glovecal_service.cli.terminal.options import AsJson, Take
from glovecal_service.cli.terminal.printing import err, out, print_json
from glovecal_service.plain import read
from glovecal_service.rest.take.answer import CheckView
from glovecal_service.rest.take.answer import Take as TakeRow


def timecode(
    take: Take,
    ltc: Annotated[
        Path | None,
        typer.Option(exists=True, dir_okay=False, help="WAV file with the sound of the time code (LTC)."),
    ] = None,
    label: Annotated[
        str | None, typer.Option("--label", help="HH:MM:SS:FF at --at; ; before the frames is drop-frame.")
    ] = None,
    at_s: Annotated[
        float,
        typer.Option(
            "--at",
            help="When the sound, or the labelled frame, begins: seconds since the take's first frame.",
        ),
    ] = 0.0,
    rate: Annotated[
        str | None, typer.Option(help=f"Frames a second: {', '.join(RATES)}. Of a sound it is measured.")
    ] = None,
    channel: Annotated[
        int | None, typer.Option(min=1, help="Of the WAV file. Default: that with most time code.")
    ] = None,
    remove: Annotated[bool, typer.Option("--remove", help="Forget the take's time code.")] = False,
    as_json: AsJson = False,
) -> None:
    """Keep which SMPTE time code a take has; without options show it."""
    if sum((ltc is not None, label is not None, remove)) > 1:
        raise typer.BadParameter("give one of --ltc, --label and --remove")
    if rate is not None and rate not in RATES:
        raise typer.BadParameter(f"--rate {rate} is none of {', '.join(RATES)}")
    body: dict[str, Any] | None = None
    if ltc is not None:
        body = _of_sound(ltc, rate, channel, at_s)
    elif label is not None:
        body = {"time_code": label, "rate": rate, "at_s": at_s}
    with connect() as service:
        row = named_take(service, take)
        if remove:
            row = read(TakeRow, service.delete(f"/takes/{row.id}/time-code"))
        elif body is not None:
            row = read(TakeRow, service.put(f"/takes/{row.id}/time-code", body))
        view = read(CheckView, service.get(f"/takes/{row.id}/check"))
    if as_json:
        print_json({"time_code": None if row.time_code is None else row.time_code.document()})
    else:
        out.print(f"Take {row.name}: {_shown(view)}.")


def _of_sound(file: Path, rate: str | None, channel: int | None, at_s: float) -> dict[str, Any]:
    from glovecal_service.ltc import read_ltc

    sound = read_ltc(file, rate=rate, channel=channel)
    for sentence in sound.sentences:
        err.print(sentence)
    code = sound.time_code
    return {"time_code": code.label, "rate": code.rate, "at_s": at_s + code.time_s, "source": code.source}


def facts_of(view: CheckView) -> dict[str, str]:
    """What is shown of a take's time code; empty where none is known."""
    code: TimeCode | None = view.take.time_code
    if code is None or not view.time_codes:
        return {}
    first, last = view.time_codes
    return {"time code": f"{first} to {last}, {code.counting.named} frames a second, from {code.source}"}


def _shown(view: CheckView) -> str:
    return "".join(f"{name} {value}" for name, value in facts_of(view).items()) or "no time code is known"
