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
from importlib import import_module
from importlib.metadata import version
from typing import Annotated, Any, NamedTuple, NoReturn

import typer
import typer.main

from glovecal_client.operating_system import HANG_UP, STOP_SIGNALS
from glovecal_client.program import handle_signals, run_command
from glovecal_client.site.member import settle_environment
from glovecal_service.cli import completion
from glovecal_service.cli.terminal.printing import EXPECTED, INTERRUPTED, err, exit_code_of, out, sentence_of
from glovecal_service.secret_files import settle_secrets

HELP = ["-h", "--help"]

START, GLOVES, TAKES, CALIBRATE, EXPLAIN, KEEP = (
    "Start", "Gloves", "Record and import", "Calibrate", "Compare, find what is missing, add it",
    "What is kept, and long work",
)  # fmt: skip
"""What people do, in the order in which they do it."""


class Verb(NamedTuple):
    """Where a verb is written: read when it is asked for, as that takes most of a short command's time."""

    panel: str
    module: str
    """Below this package."""
    attribute: str
    """A function, or the ``Typer`` of several verbs below this one."""
    form: str = ""
    """The command's own class, in the same module; empty: the usual one."""


VERBS = {
    "demo": Verb(START, "demo", "demo"),
    "serve": Verb(START, "serve", "serve"),
    "worker": Verb(START, "worker", "worker"),
    "completion": Verb(START, "completion", "completion"),
    "capture": Verb(GLOVES, "glove.capture", "capture", "WithDeviceOptions"),
    "find-port": Verb(GLOVES, "glove.find_port", "find_port"),
    "watch": Verb(GLOVES, "glove.watch", "watch"),
    "bridge": Verb(GLOVES, "glove.bridge", "bridge", "WithBridgeOptions"),
    "doctor": Verb(GLOVES, "glove.doctor", "doctor"),
    "emulate": Verb(GLOVES, "glove.emulate", "emulate", "WithFaults"),
    "card": Verb(GLOVES, "glove.card_session", "card"),
    "camera": Verb(GLOVES, "camera.cameras", "app"),
    "glove": Verb(GLOVES, "glove.layouts", "app"),
    "record": Verb(TAKES, "glove.recordings", "record"),
    "trigger": Verb(TAKES, "glove.trigger", "trigger"),
    "sample": Verb(TAKES, "sampling.samplings", "app"),
    "shapes": Verb(TAKES, "glove.shapes", "shapes"),
    "take": Verb(TAKES, "take.takes", "app"),
    "read-card": Verb(TAKES, "glove.card", "read_card"),
    "train": Verb(CALIBRATE, "model.training", "train"),
    "quick-check": Verb(CALIBRATE, "model.quick_check", "quick_check"),
    "improve": Verb(CALIBRATE, "effect.improvement", "improve", "SeveralFiles"),
    "compare": Verb(EXPLAIN, "model.comparison", "compare"),
    "where": Verb(EXPLAIN, "model.comparison", "where"),
    "": Verb(EXPLAIN, "questions", "add_questions"),
    "add-effect": Verb(EXPLAIN, "effect.changes", "add_effect"),
    "remove-effect": Verb(EXPLAIN, "effect.changes", "remove_effect"),
    "effects": Verb(EXPLAIN, "effect.catalogue", "effects"),
    "model": Verb(KEEP, "model.models", "app"),
    "subject": Verb(KEEP, "subject.subjects", "app"),
    "job": Verb(KEEP, "job.jobs", "app"),
    "key": Verb(KEEP, "access.keys", "app"),
    "person": Verb(KEEP, "access.people", "app"),
    "backup": Verb(KEEP, "backup", "app"),
    "encryption": Verb(KEEP, "access.encryption", "app"),
    "audit": Verb(KEEP, "access.audit", "app"),
    "log-mark": Verb(KEEP, "access.log_mark", "log_mark"),
    "site": Verb(KEEP, "site.sites", "app"),
}
"""In the order of ``glovecal -h``. Verbs of questions have their names from these: all stand under none."""


def some_verbs(names: Sequence[str] = tuple(VERBS)) -> typer.Typer:
    """The command with these verbs of ``VERBS``, all by default."""
    app = typer.Typer(
        name="glovecal",
        help="Joint rotations you can trust, from data gloves.\n\n"
        "With GLOVECAL_URL set it speaks to that service, else it works on the local folder GLOVECAL_DATA "
        "(./glovecal-data).",
        invoke_without_command=True,
        add_completion=False,
        pretty_exceptions_enable=False,
    )
    app.callback()(options)
    for name in names:
        panel, place, attribute, form = VERBS[name]
        module = import_module(f"glovecal_service.cli.{place}")
        written = getattr(module, attribute)
        if not name:
            written(app, panel)
        elif isinstance(written, typer.Typer):
            app.add_typer(written, name=name, rich_help_panel=panel)
        else:
            app.command(name, cls=getattr(module, form) if form else None, rich_help_panel=panel)(written)
    return app


def _print_version(wanted: bool) -> None:
    if wanted:
        out.print(f"glovecal {version('glovecal-service')}")
        raise typer.Exit


def options(
    context: typer.Context,
    show_version: Annotated[
        bool,
        typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version and exit."),
    ] = False,
) -> None:
    if context.invoked_subcommand is None:
        from glovecal_service.cli.overview import print_overview

        print_overview()


@cache
def command(names: tuple[str, ...] = tuple(VERBS)) -> Callable[..., Any]:
    """These verbs of ``VERBS``, all by default."""
    verbs = typer.main.get_command(some_verbs(names))
    _name_help(verbs)
    return verbs


def _asked(arguments: Sequence[str]) -> tuple[str, ...]:
    """What has to be read for these arguments: of a verb that is known, it alone."""
    first = next((item for item in arguments if not item.startswith("-")), None)
    if first in VERBS:
        return (first,)
    is_alone = first is None and not {"--help", *HELP} & {*arguments}
    return () if is_alone and completion.VARIABLE not in os.environ else tuple(VERBS)


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
        given = sys.argv[1:] if arguments is None else arguments
        command(_asked(given))(arguments, prog_name=completion.PROGRAM)
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
