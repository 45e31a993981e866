"""Options that several verbs share, and the names they accept."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Annotated

import typer

from glovecal_models.errors import BadInput
from glovecal_models.hand.rotations import Handedness
from glovecal_models.names import check_identifier, subject_name
from glovecal_service.cli.terminal.printing import err

MODEL_ID = re.compile(r"[0-9a-f]{6,64}\Z")
JOB_ID = re.compile(r"[0-9a-f]{12}\Z")
DEFAULT_ZENOH = "tcp/127.0.0.1:7447"


def identifier(what: str) -> Callable[[str | None], str | None]:
    """A typer callback: a name that may go into paths, keys and URLs, or wrong use of the command."""

    def check(value: str | None) -> str | None:
        if value is not None:
            try:
                check_identifier(value, what)
            except BadInput as error:
                raise typer.BadParameter(str(error)) from error
        return value

    return check


def subject_named(value: str | None) -> str | None:
    """A typer callback: a subject's name in lower case, as it is stored; says so if typed otherwise."""
    if value is None:
        return None
    try:
        stored = subject_name(value)
    except BadInput as error:
        raise typer.BadParameter(str(error)) from error
    if stored != value:
        err.print(f"Subject {value} is stored as {stored}.")
    return stored


def _model_ids(value: str | list[str]) -> str | list[str]:
    for id in [value] if isinstance(value, str) else value:
        if not MODEL_ID.match(id):
            raise typer.BadParameter(
                f"{id!r} is not a model's id: give it, or its first 6 or more digits of 0-9 and a-f, "
                "as glovecal model list shows them"
            )
    return value


def model_id(value: str | None) -> str | None:
    """A typer callback: a model's id, where one may be left out."""
    if value is not None:
        _model_ids(value)
    return value


def _job_id(value: str) -> str:
    if not JOB_ID.match(value):
        raise typer.BadParameter(
            f"{value!r} is not a job's id: 12 digits of 0-9 and a-f, as glovecal job list shows them"
        )
    return value


AsJson = Annotated[bool, typer.Option("--json", help="Print JSON on standard output and nothing else.")]
Subject = Annotated[
    str, typer.Option("--subject", "-s", help="The subject's short name.", callback=subject_named)
]
OnlyHand = Annotated[
    Handedness | None, typer.Option("--hand", help="Of a subject with two gloves, which: left or right.")
]
OnlySubject = Annotated[
    str | None, typer.Option("--subject", "-s", help="Only of this subject.", callback=subject_named)
]
OnlyLayout = Annotated[
    str | None, typer.Option("--layout", "-l", help="Only of this layout.", callback=identifier("layout"))
]
Model = Annotated[str, typer.Argument(help="Model id, or its first 6 or more digits.", callback=_model_ids)]
Models = Annotated[
    list[str], typer.Argument(help="Model ids, or their first 6 or more digits.", callback=_model_ids)
]
Job = Annotated[str, typer.Argument(help="Job id.", callback=_job_id)]
Take = Annotated[str, typer.Argument(help="Take: its name, its id, or the beginning of its id.")]
Glove = Annotated[str, typer.Argument(help="The glove's name.", callback=identifier("glove"))]
Site = Annotated[
    str,
    typer.Option(
        envvar="GLOVECAL_SITE", help="Site: the second part of every zenoh key.", callback=identifier("site")
    ),
]
Zenoh = Annotated[
    str, typer.Option("--connect", envvar="GLOVECAL_ZENOH", help="The service's zenoh endpoint.")
]
