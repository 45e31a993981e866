"""``glovecal demo``: the whole spine and the whole loop on a bare machine, no question asked."""

from __future__ import annotations

import json
import secrets
import sys
import tempfile
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from glovecal_models.errors import BadInput
from glovecal_service.cli.terminal.printing import err, out, show

if TYPE_CHECKING:
    from glovecal_client.rest import RestClient
    from glovecal_service.demo.hidden_session import HiddenSession
    from glovecal_service.demo.processes import DemoPlace
    from glovecal_service.demo.second_act import Findings

FIRST_ACT_SEED = 1
SEEDS = 10_000
"""Drawn below this: short enough to be typed again."""


def demo(
    as_json: Annotated[
        bool, typer.Option("--json", help="Print the figures as one line of JSON, last.")
    ] = False,
    keep: Annotated[bool, typer.Option("--keep", help="Leave the service and a live glove running.")] = False,
    seed: Annotated[
        int | None,
        typer.Option(min=0, help="Which simulated hands and gloves. Default: a new hidden effect each time."),
    ] = None,
    effect: Annotated[
        str,
        typer.Option(
            help="What is hidden in the second glove: random, none, unknown, or a name of glovecal effects."
        ),
    ] = "random",
    write_takes: Annotated[
        Path | None,
        typer.Option(
            file_okay=False,
            help="Only write the second glove's takes into this folder, as CSV files for the other verbs.",
        ),
    ] = None,
    smoke: Annotated[
        bool, typer.Option("--smoke", help="Seconds of the first act only: does everything run here?")
    ] = False,
) -> None:
    """Calibrate a simulated CyberGlove live, then find the effect hidden in another; under 90 seconds."""
    from glovecal_service.demo.hidden_session import check_effect, hidden_session

    if smoke:
        _smoke(FIRST_ACT_SEED if seed is None else seed)
        return
    try:
        check_effect(effect)
    except BadInput as error:
        raise typer.BadParameter(str(error), param_hint="--effect") from error
    drawn = seed if seed is not None else secrets.randbelow(SEEDS)
    if write_takes is not None:
        _write(hidden_session(effect, drawn), write_takes, effect)
        return
    _run(FIRST_ACT_SEED if seed is None else seed, effect, drawn, as_json=as_json, keep=keep)


def _run(seed: int, effect: str, drawn: int, *, as_json: bool, keep: bool) -> None:
    from glovecal_service.demo.error_fall import hidden_contract
    from glovecal_service.demo.hidden_session import hidden_session
    from glovecal_service.demo.keeping import keep_running
    from glovecal_service.demo.processes import demo_place, running_service
    from glovecal_service.demo.second_act import prepare
    from glovecal_service.demo.table import contract, error_table, sentences
    from glovecal_service.demo.walk import walk

    started = time.monotonic()
    with tempfile.TemporaryDirectory(prefix="glovecal-demo-") as folder:
        place = demo_place(Path(folder))
        err.print("Starting glovecal serve ...")
        with running_service(place) as service:
            hidden = hidden_session(effect, drawn)
            # its models are trained while the takes of the first act are recorded, at their own pace
            second = prepare(service, hidden, place.folder / "hidden")
            found = walk(service, place, seed, lambda sentence: err.print(sentence))
            out.print()
            show(error_table(found))
            out.print()
            for sentence in sentences(found):
                out.print(sentence)
            _second_act(service, place, hidden, second)
            seconds = time.monotonic() - started
            out.print(
                f"\nAll this was done by glovecal serve, capture and REST in {seconds:.0f} s. Gloves and "
                "hands are simulated; their truth is known."
            )
            out.print(NEXT)
            if as_json:
                sys.stdout.write(json.dumps(contract(found) | hidden_contract(hidden, second)) + "\n")
                sys.stdout.flush()
            if keep:
                keep_running(place, seed, lambda sentence: err.print(sentence))


def _smoke(seed: int) -> None:
    from glovecal_service.demo.processes import demo_place, running_service
    from glovecal_service.demo.table import contract
    from glovecal_service.demo.walk import SMOKE, walk

    with tempfile.TemporaryDirectory(prefix="glovecal-demo-") as folder:
        place = demo_place(Path(folder))
        with running_service(place) as service:
            found = contract(walk(service, place, seed, lambda sentence: err.print(sentence), SMOKE))
    error, frames = found["rmse_deg"], found["frames"]
    out.print(
        f"Smoke test of the demo: error {error['raw']:.1f} degrees raw, {error['linear']:.1f} linear; "
        f"{frames['sent']} frames sent live, {frames['received']} poses received."
    )


def _second_act(service: RestClient, place: DemoPlace, hidden: HiddenSession, found: Findings) -> None:
    from glovecal_service.demo.error_fall import chart, fall, verdict
    from glovecal_service.demo.live_child import live_child, live_sentence
    from glovecal_service.demo.second_act import second_act

    plan = hidden.session.plan
    out.print(
        f"\nSecond act: another simulated subject, {plan.takes} takes in {plan.wearings} wearings of a glove "
        f"with {len(plan.sensors)} sensors.\nSomething may be hidden in it (seed {hidden.seed}; --seed "
        f"{hidden.seed} shows it again). {plan.takes - len(found.tests)} takes are for training, "
        f"{len(found.tests)} for testing."
    )

    def live() -> None:
        out.print(live_sentence(live_child(service, place, hidden.live(), found)))

    second_act(service, found, out.print, err.print, live)
    out.print("\nError on takes not trained on, all rotations (degrees, RMSE):")
    for line in (*chart(found), *fall(found), "", *verdict(hidden, found)):
        out.print(line)


def _write(hidden: HiddenSession, folder: Path, effect: str) -> None:
    training, test = hidden.write(folder)
    out.print(f"{training}: {len(hidden.training)} simulated takes to learn from")
    out.print(f"{test}: {len(hidden.test)} simulated takes to test on")
    out.print(f"{hidden.write_truth(folder)}: what is hidden in them; look at it last")
    out.print(
        f"Made by glovecal demo --effect {effect} --seed {hidden.seed}; column c.simulated marks every row."
    )


NEXT = """
Where to look next:
  docs/tutorial.md          the second act by your own hand, verb by verb
  glovecal demo --effect hysteresis | none | unknown   another effect, none, or one that has no name
  glovecal demo --keep      leaves it running, with the address of its REST interface
  glovecal serve            your own service; then glovecal capture --device cyberglove --glove right
  glovecal take import      calibrate from recordings you have (CSV, Parquet)
  README.md                 connect your glove, walk the loop, deploy"""
