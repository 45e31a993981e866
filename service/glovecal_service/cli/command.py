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
from glovecal_client.program import handle_signals, run_command
from glovecal_client.site.member import settle_environment
from glovecal_service.cli import backup, completion, demo, overview, serve, worker
from glovecal_service.cli.access import audit, encryption, keys, log_mark, people
from glovecal_service.cli.asking import verb, verb_at_once
from glovecal_service.cli.camera import cameras
from glovecal_service.cli.effect import catalogue, changes, improvement
from glovecal_service.cli.glove import (
    bridge,
    capture,
    card,
    card_session,
    doctor,
    emulate,
    find_port,
    layouts,
    recordings,
    shapes,
    trigger,
    watch,
)
from glovecal_service.cli.job import jobs
from glovecal_service.cli.model import comparison, models, quick_check, training
from glovecal_service.cli.sampling import samplings
from glovecal_service.cli.site import sites
from glovecal_service.cli.subject import subjects
from glovecal_service.cli.take import takes
from glovecal_service.cli.terminal.printing import EXPECTED, INTERRUPTED, err, exit_code_of, out, sentence_of
from glovecal_service.questions.catalogue import AT_ONCE, QUESTIONS
from glovecal_service.secret_files import settle_secrets

HELP = ["-h", "--help"]

app = typer.Typer(
    name="glovecal",
    help="Joint rotations you can trust, from data gloves.\n\n"
    "With GLOVECAL_URL set it speaks to that service, else it works on the local folder GLOVECAL_DATA "
    "(./glovecal-data).",
    invoke_without_command=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)
START, GLOVES, TAKES, CALIBRATE, EXPLAIN, KEEP = (
    "Start", "Gloves", "Record and import", "Calibrate", "Compare, find what is missing, add it",
    "What is kept, and long work",
)  # fmt: skip
"""What people do, in the order in which they do it."""
app.command("demo", rich_help_panel=START)(demo.demo)
app.command("serve", rich_help_panel=START)(serve.serve)
app.command("worker", rich_help_panel=START)(worker.worker)
app.command("completion", rich_help_panel=START)(completion.completion)
app.command("capture", cls=capture.WithDeviceOptions, rich_help_panel=GLOVES)(capture.capture)
app.command("find-port", rich_help_panel=GLOVES)(find_port.find_port)
app.command("watch", rich_help_panel=GLOVES)(watch.watch)
app.command("bridge", cls=bridge.WithBridgeOptions, rich_help_panel=GLOVES)(bridge.bridge)
app.command("doctor", rich_help_panel=GLOVES)(doctor.doctor)
app.command("emulate", cls=emulate.WithFaults, rich_help_panel=GLOVES)(emulate.emulate)
app.command("card", rich_help_panel=GLOVES)(card_session.card)
app.add_typer(cameras.app, name="camera", rich_help_panel=GLOVES)
app.add_typer(layouts.app, name="glove", rich_help_panel=GLOVES)
app.command("record", rich_help_panel=TAKES)(recordings.record)
app.command("trigger", rich_help_panel=TAKES)(trigger.trigger)
app.add_typer(samplings.app, name="sample", rich_help_panel=TAKES)
app.command("shapes", rich_help_panel=TAKES)(shapes.shapes)
app.add_typer(takes.app, name="take", rich_help_panel=TAKES)
app.command("read-card", rich_help_panel=TAKES)(card.read_card)
app.command("train", rich_help_panel=CALIBRATE)(training.train)
app.command("quick-check", rich_help_panel=CALIBRATE)(quick_check.quick_check)
app.command("improve", cls=improvement.SeveralFiles, rich_help_panel=CALIBRATE)(improvement.improve)
app.command("compare", rich_help_panel=EXPLAIN)(comparison.compare)
app.command("where", rich_help_panel=EXPLAIN)(comparison.where)
for question in QUESTIONS.values():
    if question.verb is not None:
        app.command(question.verb, rich_help_panel=EXPLAIN)(verb(question))
for question in AT_ONCE.values():
    if question.verb is not None:
        app.command(question.verb, rich_help_panel=EXPLAIN)(verb_at_once(question))
app.command("add-effect", rich_help_panel=EXPLAIN)(changes.add_effect)
app.command("remove-effect", rich_help_panel=EXPLAIN)(changes.remove_effect)
app.command("effects", rich_help_panel=EXPLAIN)(catalogue.effects)
app.add_typer(models.app, name="model", rich_help_panel=KEEP)
app.add_typer(subjects.app, name="subject", rich_help_panel=KEEP)
app.add_typer(jobs.app, name="job", rich_help_panel=KEEP)
app.add_typer(keys.app, name="key", rich_help_panel=KEEP)
app.add_typer(people.app, name="person", rich_help_panel=KEEP)
app.add_typer(backup.app, name="backup", rich_help_panel=KEEP)
app.add_typer(encryption.app, name="encryption", rich_help_panel=KEEP)
app.add_typer(audit.app, name="audit", rich_help_panel=KEEP)
app.command("log-mark", rich_help_panel=KEEP)(log_mark.log_mark)
app.add_typer(sites.app, name="site", rich_help_panel=KEEP)


def _print_version(wanted: bool) -> None:
    if wanted:
        out.print(f"glovecal {version('glovecal-service')}")
        raise typer.Exit


@app.callback()
def options(
    context: typer.Context,
    show_version: Annotated[
        bool,
        typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version and exit."),
    ] = False,
) -> None:
    if context.invoked_subcommand is None:
        overview.print_overview()


@cache
def command() -> Callable[..., Any]:
    """The verbs of ``app``, which take a fifth of a second to put together."""
    verbs = typer.main.get_command(app)
    _name_help(verbs)
    return verbs


def _name_help(verb: Any) -> None:
    """Of each verb itself: it keeps the names under which its help was asked for first."""
    verb.context_settings["help_option_names"] = HELP
    for part in getattr(verb, "commands", {}).values():
        _name_help(part)


def script() -> NoReturn:
    """Entry point of the ``glovecal`` script."""
    _leave_start_folder()
    handle_signals(_stop, *(number for number in STOP_SIGNALS if number != signal.SIGINT), *HANG_UP)
    run_command(main)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the verb of ``arguments``, the process's own by default; ends in SystemExit where it is refused."""
    completion.prepare()
    settle_environment()
    try:
        settle_secrets()
        command()(arguments, prog_name=completion.PROGRAM)
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
