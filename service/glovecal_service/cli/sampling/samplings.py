"""``glovecal sample``: lead a person through poses and motions whose angles are known."""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.live import Live
from rich.text import Text

from glovecal_client.errors import ServiceError
from glovecal_models.documents import read_json
from glovecal_models.errors import BadInput
from glovecal_models.names import check_identifier
from glovecal_models.sampling.catalogue import PROTOCOLS, Order
from glovecal_models.sampling.state import TRIGGERS
from glovecal_service.cli.sampling.next_steps import next_steps
from glovecal_service.cli.terminal.connection import connect
from glovecal_service.cli.terminal.listing import (
    AfterPlace,
    EveryRow,
    MostRows,
    Since,
    Wanted,
    filtered,
)
from glovecal_service.cli.terminal.options import JOB_ID, AsJson, OnlySubject, identifier, subject_named
from glovecal_service.cli.terminal.printing import Refusal, err, out, print_json, print_table
from glovecal_service.operating_system import single_keys
from glovecal_service.plain import read
from glovecal_service.rest.sampling.answer import SamplingView
from glovecal_service.rest.take.answer import Take

if TYPE_CHECKING:
    from glovecal_client.rest import RestClient

app = typer.Typer(help="Guided sampling: takes with known angles.", invoke_without_command=True)


def _sampling_id(value: str) -> str:
    """A typer callback."""
    if not JOB_ID.match(value):
        raise typer.BadParameter(
            f"{value!r} is not a sampling's id: 12 digits of 0-9 and a-f, as glovecal sample list shows them"
        )
    return value


@app.callback()
def sample(
    context: typer.Context,
    glove: Annotated[str, typer.Option(help="The glove's name.")] = "",
    subject: Annotated[
        str | None, typer.Option("--subject", "-s", help="Who wears it.", callback=subject_named)
    ] = None,
    wearing: Annotated[str | None, typer.Option(help="Default: the glove's wearing.")] = None,
    protocol: Annotated[str, typer.Option(help=f"One of {', '.join(PROTOCOLS)}.")] = "new_subject",
    trigger: Annotated[
        str, typer.Option(help=f"What starts a step: {', '.join(TRIGGERS)} (hand held still).")
    ] = "key",
    widget: Annotated[
        list[str] | None, typer.Option(help="Widgets you have, such as IM_ABD=0,12,20; repeatable.")
    ] = None,
    poses: Annotated[
        Path | None, typer.Option(help="JSON file of measured angles: pose, rotation, degrees.")
    ] = None,
    order: Annotated[
        Order,
        typer.Option(
            help="Of poses and widgets. random: the first again at the end, so that drift cannot look like "
            "posture. fixed: the paper's."
        ),
    ] = "random",
    seed: Annotated[int | None, typer.Option(min=0, help="Of the random order; default: a new one.")] = None,
    rod: Annotated[list[float] | None, typer.Option(help="Length of a rod in mm; repeatable.")] = None,
    as_json: AsJson = False,
) -> None:
    """Lead a person through a protocol. Keys: space starts a step, r repeats, u undoes, s skips,
    q pauses and quits."""
    if context.invoked_subcommand is not None:
        return
    for what, value in (("glove", glove), ("subject", subject)):
        if not value:
            raise typer.BadParameter(f"give --{what}")
    check_identifier(glove, "glove")
    wanted: dict[str, Any] = {"glove": glove, "subject": subject, "protocol": protocol, "trigger": trigger}
    wanted |= {"order": order, "seed": seed, "pose_deg": _pose_angles(poses)}
    wanted |= {"widget_deg": _widget_angles(widget or [])} | ({"rod_mm": rod} if rod else {})
    wanted |= {} if wearing is None else {"wearing": wearing}
    _require_keyboard(trigger)
    with connect() as service:
        _lead(service, read(SamplingView, service.post("/sampling", wanted)), as_json)


@app.command("list")
def list_samplings(
    glove: Annotated[
        str | None, typer.Option(help="Only this glove's.", callback=identifier("glove"))
    ] = None,
    subject: OnlySubject = None,
    since: Since = None,
    limit: MostRows = None,
    every: EveryRow = False,
    after: AfterPlace = None,
    as_json: AsJson = False,
) -> None:
    """Show samplings, newest first."""
    query = {"glove": glove, "subject": subject, "since": since}
    wanted = Wanted(limit, every, after, as_json)
    with connect() as service:
        views = wanted.rows(service, SamplingView, "/sampling", filtered("sample list", **query), query)
    rows = [
        {
            **vars(view),
            "done": f"{sum(step.outcome == 'good' for step in view.steps)} of {len(view.steps)}",
            "takes": len(view.takes),
        }
        for view in views
    ]
    headings = {"id": "id", "glove": "glove", "subject": "subject", "protocol": "protocol", "phase": "phase"}
    more = {"done": "steps done", "takes": "takes", "created_at": "started"}
    print_table(
        rows, headings | more, empty="No sampling yet. Start one: glovecal sample --glove NAME --subject NAME"
    )


app.command("next")(next_steps)


@app.command("resume")
def resume(
    sampling: Annotated[str, typer.Argument(help="Sampling id.", callback=_sampling_id)],
    as_json: AsJson = False,
) -> None:
    """Continue an interrupted sampling."""
    with connect() as service:
        view = read(SamplingView, service.get(f"/sampling/{sampling}"))
        if not view.open:
            raise Refusal(f"sampling {sampling} is {view.phase}; its takes are stored")
        _require_keyboard(view.trigger)
        if view.phase == "paused":
            view = read(SamplingView, service.post(f"/sampling/{sampling}/resume"))
        _lead(service, view, as_json)


def _require_keyboard(trigger: str) -> None:
    if trigger == "key" and not sys.stdin.isatty():
        raise Refusal("there is no terminal to read keys from; use --trigger timer or --trigger still")


def _lead(service: RestClient, view: SamplingView, as_json: bool) -> None:
    view = walk(service, view, quiet=as_json)
    if as_json:
        print_json(view.model_dump(mode="json"))
        return
    if view.open:
        out.print(f"Interrupted. Continue with: glovecal sample resume {view.id}")
        return
    bad = [step for step in view.steps if step.outcome != "good"]
    for step in bad:
        out.print(f"{step.name}: {step.outcome or 'not done'}. {' '.join(step.reasons)}".rstrip())
    for sentence in (*view.sentences, view.problem):
        if sentence:
            out.print(sentence)
    out.print(
        f"{len(view.takes)} takes of {len(view.steps) - len(bad)} steps; {view.capture_s:.0f} s of capture."
    )
    if view.takes and view.protocol != "second_wearing":
        hand = read(Take, service.get(f"/takes/{view.takes[0]}")).known_hand
        by = "" if view.method == "lmc_gpr" else f" --method {view.method}"
        whose = f" --hand {hand}" if hand else ""
        out.print(f"Next: glovecal train --subject {view.subject}{whose}{by}")
    elif view.takes:
        named = " ".join(f"--take {take}" for take in view.takes)
        out.print(f"Next: glovecal quick-check --subject {view.subject} {named} --activate")


def _widget_angles(told: Sequence[str]) -> dict[str, list[float]]:
    """``IM_ABD=0,12,20`` as degrees by rotation; nothing after ``=`` leaves the rotation out."""
    angles = {}
    for text in told:
        rotation, equals, numbers = text.partition("=")
        try:
            angles[rotation] = [float(number) for number in numbers.split(",") if number.strip()]
        except ValueError:
            equals = ""
        if not equals:
            raise typer.BadParameter(f"--widget {text!r}: write it like IM_ABD=0,12,20")
    return angles


def _pose_angles(path: Path | None) -> dict[str, Any]:
    """The content of a JSON file. Raises BadInput, OSError."""
    if path is None:
        return {}
    document = read_json(path.read_bytes(), str(path))
    if not isinstance(document, dict):
        raise BadInput(f'{path}: write it like {{"flat": {{"I_MCP": 2.5}}}}')
    return document


# A sampling in the terminal: what is said, a bar that shows how still the hand is, and the user's keys.


LOOK_EVERY_S = 0.12
TAKES_WITHIN_S = 60.0
BAR = 20
KEYS = {" ": "go", "r": "redo", "u": "undo", "s": "skip", "q": "pause"}
HELP = "space: start   r: repeat   u: undo   s: skip   q: pause"


def walk(service: RestClient, view: SamplingView, *, quiet: bool = False) -> SamplingView:
    """Follow the sampling to its end, or until the user pauses; the last view of it."""
    path, said = f"/sampling/{view.id}", 0
    shown = Live(console=out, auto_refresh=False, transient=True) if out.is_terminal and not quiet else None
    with shown or nullcontext(), single_keys() as key:
        try:
            while view.phase not in ("done", "stopped", "paused"):
                if view.say_number > said and not quiet:
                    out.print(view.say)
                said = max(said, view.say_number)
                if shown is not None:
                    shown.update(_picture(view), refresh=True)
                event = KEYS.get(key(LOOK_EVERY_S))
                view = read(SamplingView, service.get(path)) if event is None else _send(service, path, event)
        except KeyboardInterrupt:
            return read(SamplingView, service.post(f"{path}/pause"))
    if not quiet:
        out.print(view.say)
    return view if view.phase == "paused" else _with_takes(service, path)


def _send(service: RestClient, path: str, event: str) -> SamplingView:
    try:
        return read(SamplingView, service.post(f"{path}/{event}"))
    except ServiceError as error:
        if error.status != 409:
            raise
        err.print(error.detail)
        return read(SamplingView, service.get(path))


def _with_takes(service: RestClient, path: str) -> SamplingView:
    until = time.monotonic() + TAKES_WITHIN_S
    while (view := read(SamplingView, service.get(path))).open and time.monotonic() < until:
        time.sleep(LOOK_EVERY_S)
    return view


def _picture(view: SamplingView) -> Text:
    place, name = (view.step.place, view.step.name) if view.step else (0, "")
    spent = f"{view.capture_s:.0f} of about {view.capture_of_s:.0f} s"
    line = f"[{place}/{len(view.steps)}] {name}: {view.phase}{_left(view)}   {spent}\n"
    return Text(f"{line}{_steadiness(view)}\n{view.problem or HELP}")


def _left(view: SamplingView) -> str:
    if view.phase_of_s is None:
        return ""
    return f" {max(0.0, view.phase_of_s - view.phase_s):.1f} s"


def _steadiness(view: SamplingView) -> str:
    """The bar is full at four times what is still."""
    percent, still = view.steadiness_percent, view.still_percent
    if percent is None:
        return "no frames yet"
    blocks = min(BAR, round(BAR * percent / (4 * still)))
    word = "still" if percent <= still else "moving"
    drawn = "█" * blocks + "·" * (BAR - blocks)
    return f"{drawn} {word}: {percent:.1f} % of a sensor's range (still: below {still:g} %)"
