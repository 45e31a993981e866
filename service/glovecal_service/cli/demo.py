"""``glovecal demo``: the whole spine and the whole loop on a bare machine; on a terminal one may stay."""

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
    from glovecal_service.demo.processes import DemoPlace
    from glovecal_service.demo.second_act import Findings
    from glovecal_service.first_run.hidden_session import HiddenSession

FIRST_ACT_SEED = 1


def demo(
    as_json: Annotated[
        bool, typer.Option("--json", help="Print the figures as one line of JSON at the end.")
    ] = False,
    stay: Annotated[
        bool | None,
        typer.Option(
            "--stay/--no-stay",
            help="At the end, open the studio and keep the glove with the hidden effect moving until Ctrl-C. "
            "Default: ask on a terminal, else end.",
        ),
    ] = None,
    seed: Annotated[
        int | None,
        typer.Option(min=0, help="Seed of the simulation. Default: another hidden effect each time."),
    ] = None,
    effect: Annotated[
        str,
        typer.Option(
            help="Effect hidden in the second glove: random, none, unknown, or a name from glovecal effects."
        ),
    ] = "random",
    write_takes: Annotated[
        Path | None,
        typer.Option(
            file_okay=False,
            help="Only write the second glove's takes to this folder as CSV files.",
        ),
    ] = None,
    smoke: Annotated[
        bool, typer.Option("--smoke", help="Run a few seconds of the first part as a self-test.")
    ] = False,
) -> None:
    """Calibrate a simulated CyberGlove live, then find the effect hidden in another; under 90 seconds."""
    from glovecal_service.first_run.hidden_effect import SEEDS
    from glovecal_service.first_run.hidden_session import check_effect, hidden_session

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
    _run(FIRST_ACT_SEED if seed is None else seed, effect, drawn, as_json=as_json, stay=stay)


def _run(seed: int, effect: str, drawn: int, *, as_json: bool, stay: bool | None) -> None:
    from glovecal_service.demo.processes import demo_place, running_service
    from glovecal_service.demo.second_act import hidden_contract, prepare
    from glovecal_service.demo.staying import stay as stay_there
    from glovecal_service.demo.staying import wants_to_stay
    from glovecal_service.demo.walk import contract, error_table, sentences, walk
    from glovecal_service.first_run.hidden_session import hidden_session

    started = time.monotonic()
    with tempfile.TemporaryDirectory(prefix="glovecal-demo-") as folder:
        place = demo_place(Path(folder))
        err.print("Starting glovecal serve ...")
        with running_service(place) as service:
            err.print(f"The studio, as long as the demo runs: {place.url}/studio/live")
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
                f"\nDone with glovecal serve, capture and REST in {seconds:.0f} s. Gloves and hands are "
                "simulated, so the true angles are known."
            )
            out.print(NEXT + (PAGES if (CHECKOUT / "docs" / "tutorial.md").is_file() else ""))
            if as_json:
                sys.stdout.write(json.dumps(contract(found) | hidden_contract(hidden, second)) + "\n")
                sys.stdout.flush()
            if stay or (stay is None and wants_to_stay(as_json=as_json)):
                stay_there(service, place, hidden, second, lambda sentence: err.print(sentence))


def _smoke(seed: int) -> None:
    from glovecal_service.demo.processes import demo_place, running_service
    from glovecal_service.demo.walk import SMOKE, rmse_deg, walk

    with tempfile.TemporaryDirectory(prefix="glovecal-demo-") as folder:
        place = demo_place(Path(folder))
        with running_service(place) as service:
            found = walk(service, place, seed, lambda sentence: err.print(sentence), SMOKE)
    error = rmse_deg(found)
    out.print(
        f"Smoke test of the demo: error {error['raw']:.1f} degrees raw, {error['linear']:.1f} linear; "
        f"{found.sent} frames sent live, {found.meter.counts.received} poses received."
    )


def _second_act(service: RestClient, place: DemoPlace, hidden: HiddenSession, found: Findings) -> None:
    from glovecal_service.demo.second_act import chart, fall, second_act, verdict
    from glovecal_service.demo.staying import live_child, live_sentence

    plan = hidden.session.plan
    out.print(
        f"\nSecond part: another simulated subject, {plan.takes} takes in {plan.wearings} wearings of a "
        f"glove with {len(plan.sensors)} sensors.\nThe glove may have a hidden effect (repeat with --seed "
        f"{hidden.seed}). {plan.takes - len(found.tests)} takes for training, {len(found.tests)} held out."
    )

    def live() -> None:
        out.print(live_sentence(live_child(service, place, hidden.live(), found)))

    second_act(service, found, out.print, err.print, live)
    out.print("\nHeld-out error, all rotations (RMSE, degrees):")
    for line in (*chart(found), *fall(found), "", *verdict(hidden, found)):
        out.print(line)


def _write(hidden: HiddenSession, folder: Path, effect: str) -> None:
    training, test = hidden.write(folder)
    out.print(f"{training}: {len(hidden.training)} simulated takes for training")
    out.print(f"{test}: {len(hidden.test)} simulated takes held out for testing")
    out.print(f"{hidden.write_truth(folder)}: the hidden effect (the answer)")
    out.print(
        f"Made by glovecal demo --effect {effect} --seed {hidden.seed}; column c.simulated marks every row."
    )


CHECKOUT = Path(__file__).parents[3]
NEXT = """
Next:
  glovecal demo --effect hysteresis | none | unknown   another effect, none, or one outside the catalogue
  glovecal demo --stay      opens the studio at the end and keeps its glove moving
  glovecal serve            your own service; then: glovecal capture --device cyberglove --glove right
  glovecal take import FILE --subject NAME   calibrate from recordings you have (CSV, Parquet)"""
PAGES = """
  docs/tutorial.md          the second part step by step, command by command
  README.md                 connect your glove, improve its model, deploy"""
"""Of a checkout: a wheel brings none."""
