"""``glovecal quick-check``: put a stored calibration right for a new wearing, with a few held poses."""

from __future__ import annotations

from typing import Annotated

import typer

from glovecal_service.cli.model.models import active_model
from glovecal_service.cli.take.rows import named_takes
from glovecal_service.cli.terminal.connection import connect
from glovecal_service.cli.terminal.options import AsJson, OnlyLayout, OnlySubject, model_id
from glovecal_service.cli.terminal.presenting import present
from glovecal_service.cli.terminal.printing import read_or_print
from glovecal_service.questions.quick_check import QUESTION


def quick_check(
    model: Annotated[
        str | None,
        typer.Argument(help="Model id, or its first 6 or more digits; or --subject.", callback=model_id),
    ] = None,
    take: Annotated[
        list[str] | None, typer.Option("--take", "-t", help="Take with the held poses; repeat.")
    ] = None,
    subject: OnlySubject = None,
    layout: OnlyLayout = None,
    activate: Annotated[bool, typer.Option("--activate", help="Predict live with the new model.")] = False,
    as_json: AsJson = False,
) -> None:
    """Learn how a new wearing shifted from three to five held poses, instead of calibrating again.

    With --subject the active model is checked. The model itself never changes: a child of it is stored;
    glovecal model rollback returns to the one before.
    """
    if not take:
        raise typer.BadParameter("name the takes with the poses: --take NAME")
    with connect() as service:
        chosen = model or active_model(service, subject, layout)
        rows = named_takes(service, take)
        body = {"takes": [row.id for row in rows], "activate": activate}
        found = service.post(f"/models/{chosen}/quick-check", body)
    present(read_or_print(QUESTION.answer, found, as_json).presentation())
