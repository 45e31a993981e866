"""The ``glovecal`` command: collects the verbs and turns refusals into one sentence and an exit code.

Exit codes: 0 done, 1 refused (the sentence says why), 2 wrong use of the command, 3 no service reached,
130 interrupted.
"""

from __future__ import annotations

import sys

import typer

from glovecal_service.cli import (
    capture,
    compare,
    demo,
    find_port,
    glove,
    job,
    model,
    record,
    serve,
    subject,
    take,
    train,
    watch,
)
from glovecal_service.cli.printing import err

app = typer.Typer(
    name="glovecal",
    help="Joint rotations you can trust, from data gloves. "
    "With GLOVECAL_URL set it speaks to that service, else it works on the local folder GLOVECAL_DATA.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)
app.command("demo")(demo.demo)
app.command("serve")(serve.serve)
app.command("capture")(capture.capture)
app.command("find-port")(find_port.find_port)
app.command("watch")(watch.watch)
app.command("record")(record.record)
app.add_typer(subject.app, name="subject")
app.add_typer(glove.app, name="glove")
app.add_typer(take.app, name="take")
app.command("train")(train.train)
app.add_typer(model.app, name="model")
app.command("compare")(compare.compare)
app.add_typer(job.app, name="job")


def main() -> None:
    """Entry point of the ``glovecal`` script."""
    from glovecal_client.errors import ClientError
    from glovecal_models.errors import GlovecalError

    try:
        app()
    except KeyboardInterrupt:
        err.print("interrupted")
        sys.exit(130)
    except (GlovecalError, ClientError) as error:
        err.print(str(error), markup=False, style="red")
        sys.exit(getattr(error, "exit_code", 1))


if __name__ == "__main__":
    main()
