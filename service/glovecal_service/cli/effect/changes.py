"""``glovecal add-effect`` and ``remove-effect``: a new version of a model with or without one effect."""

from __future__ import annotations

import re
from typing import Annotated, Any
from urllib.parse import quote

import typer

from glovecal_service.cli.take.rows import named_takes
from glovecal_service.cli.terminal.connection import connect
from glovecal_service.cli.terminal.options import AsJson, Model
from glovecal_service.cli.terminal.presenting import present
from glovecal_service.cli.terminal.printing import read_or_print
from glovecal_service.cli.terminal.waiting import begun_job, wait_for_job
from glovecal_service.questions.add_effect import ADD_EFFECT
from glovecal_service.questions.remove_effect import REMOVE_EFFECT

Effect = Annotated[str, typer.Argument(help="The effect's name, as in glovecal effects.")]
Activate = Annotated[bool, typer.Option("--activate", help="Predict live with the new model.")]

_NAMED = re.compile(r"(?:^|[;\n])\s*name\s*=\s*([^;\n]*)")
_COLUMNS = re.compile(r"(?:^|[;\n])\s*columns\s*=")


def add_effect(
    model: Model,
    effect: Effect,
    rotation: Annotated[
        list[str] | None,
        typer.Option("--rotation", "-r", help="Rotation to correct; repeat. Default: all it has learned."),
    ] = None,
    expression: Annotated[
        str | None,
        typer.Option("--expression", "-e", help="Makes EFFECT an effect of your own: 'c.strap_n * own'."),
    ] = None,
    take: Annotated[
        list[str] | None,
        typer.Option("--take", "-t", help="Take to learn from; repeat. Default: those it was trained on."),
    ] = None,
    activate: Activate = False,
    as_json: AsJson = False,
) -> None:
    """Give a model one more effect; it stays only if the error on takes left out falls.

    The model itself never changes: a child of it is stored, or nothing when the effect was undone.
    """
    wanted: Any = effect if expression is None else {"declaration": _declaration_text(effect, expression)}
    with connect() as service:
        rows = named_takes(service, take or [])
        body: dict[str, Any] = {"effect": wanted, "rotations": rotation or None, "activate": activate}
        body |= {"takes": [row.id for row in rows] or None}
        job = begun_job(service.post(f"/models/{model}/effects", body))
        result = wait_for_job(service, job, quiet=as_json).result
    present(read_or_print(ADD_EFFECT.answer, result, as_json).presentation())


def remove_effect(model: Model, effect: Effect, activate: Activate = False, as_json: AsJson = False) -> None:
    """Take an effect out of a model: a child of it is learned without."""
    with connect() as service:
        query = {"activate": "true"} if activate else None
        job = begun_job(service.delete(f"/models/{model}/effects/{quote(effect, safe='')}", query))
        result = wait_for_job(service, job, quiet=as_json).result
    present(read_or_print(REMOVE_EFFECT.answer, result, as_json).presentation())


def _declaration_text(name: str, expression: str) -> str:
    """``strap`` and ``c.strap_n * own; unit = deg`` make a declaration; a whole one stays as it is.

    Raises typer.BadParameter when the text gives another name.
    """
    given = _NAMED.search(expression)
    if given is not None and given.group(1).strip() != name:
        raise typer.BadParameter(
            f"the effect is called {name!r}, but --expression names it {given.group(1).strip()!r}"
        )
    text = expression if _COLUMNS.search(expression) else f"columns = {expression}"
    return text if given is not None else f"name = {name}; {text}"
