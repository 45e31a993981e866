"""The ``glovecal`` command: collects the verbs and turns refusals into one sentence and an exit code.

Exit codes: 0 done, 1 refused (the sentence says why) or done but nobody read the answer (a closed pipe, a
full disk), 2 wrong use of the command, 3 no service reached, 130 interrupted.
"""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Callable, Sequence
from functools import cache
from importlib.metadata import version
from typing import Annotated, Any, NoReturn

import typer
import typer.main

from glovecal_client.operating_system import HANG_UP, STOP_SIGNALS
from glovecal_client.signals import handle_signals
from glovecal_client.standard_streams import run_command
from glovecal_service.cli import demo, serve
from glovecal_service.cli.camera import cameras
from glovecal_service.cli.effect import catalogue, changes, detectability, diagnosis, improvement
from glovecal_service.cli.glove import (
    capture,
    card,
    card_session,
    doctor,
    emulate,
    find_port,
    layouts,
    recordings,
    shapes,
    watch,
)
from glovecal_service.cli.job import jobs
from glovecal_service.cli.model import ceiling, comparison, explain, models, quick_check, training, where
from glovecal_service.cli.sampling import samplings
from glovecal_service.cli.subject import subjects
from glovecal_service.cli.take import takes
from glovecal_service.cli.terminal.printing import err, out
from glovecal_service.cli.terminal.refusal import EXPECTED, INTERRUPTED, exit_code_of, sentence_of

app = typer.Typer(
    name="glovecal",
    help="Joint rotations you can trust, from data gloves.\n\n"
    "With GLOVECAL_URL set it speaks to that service, else it works on the local folder GLOVECAL_DATA "
    "(./glovecal-data).",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)
app.command("demo")(demo.demo)
app.command("serve")(serve.serve)
app.command("capture", cls=capture.WithDeviceOptions)(capture.capture)
app.command("find-port")(find_port.find_port)
app.command("emulate", cls=emulate.WithFaults)(emulate.emulate)
app.command("card")(card_session.card)
app.command("read-card")(card.read_card)
app.command("watch")(watch.watch)
app.command("doctor")(doctor.doctor)
app.command("record")(recordings.record)
app.command("shapes")(shapes.shapes)
app.add_typer(cameras.app, name="camera")
app.add_typer(samplings.app, name="sample")
app.add_typer(subjects.app, name="subject")
app.add_typer(layouts.app, name="glove")
app.add_typer(takes.app, name="take")
app.command("train")(training.train)
app.add_typer(models.app, name="model")
app.command("quick-check")(quick_check.quick_check)
app.command("compare")(comparison.compare)
app.command("where")(where.where)
app.command("explain")(explain.explain)
app.command("ceiling")(ceiling.ceiling)
app.command("diagnose")(diagnosis.diagnose)
app.command("detectable")(detectability.detectable)
app.command("add-effect")(changes.add_effect)
app.command("remove-effect")(changes.remove_effect)
app.command("improve", cls=improvement.SeveralFiles)(improvement.improve)
app.command("effects")(catalogue.effects)
app.add_typer(jobs.app, name="job")


def _print_version(wanted: bool) -> None:
    if wanted:
        out.print(f"glovecal {version('glovecal-service')}")
        raise typer.Exit


@app.callback()
def options(
    show_version: Annotated[
        bool,
        typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version and exit."),
    ] = False,
) -> None:
    pass


@cache
def command() -> Callable[..., Any]:
    """The verbs of ``app``, which take a fifth of a second to put together."""
    return typer.main.get_command(app)


def script() -> NoReturn:
    """Entry point of the ``glovecal`` script."""
    _leave_start_folder()
    handle_signals(_stop, *(number for number in STOP_SIGNALS if number != signal.SIGINT), *HANG_UP)
    run_command(main)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the verb of ``arguments``, the process's own by default; ends in SystemExit where it is refused."""
    try:
        command()(arguments, prog_name="glovecal")
    except KeyboardInterrupt:
        err.print("interrupted")
        sys.exit(INTERRUPTED)
    except EXPECTED as error:
        err.print(sentence_of(error), style="red")
        sys.exit(exit_code_of(error))


def _leave_start_folder() -> None:
    """No process of ours imports what lies in the folder it happens to be started in.

    Python looks there first, unless told otherwise, in processes that it starts for ``multiprocessing``.
    """
    os.environ["PYTHONSAFEPATH"] = "1"
    if not sys.flags.safe_path and sys.path[0] in ("", os.getcwd()):  # begun as python -m
        del sys.path[0]


def _stop(number: int, _frame: object) -> NoReturn:
    """Asked to stop: go through every ``finally``, so that no process of ours is left behind."""
    raise SystemExit(128 + number)


if __name__ == "__main__":
    script()
