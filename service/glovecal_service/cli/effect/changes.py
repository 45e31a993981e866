"""``glovecal add-effect`` and ``remove-effect``: a new version of a model with or without one effect."""

from __future__ import annotations

import re
from typing import Annotated, Any
from urllib.parse import quote

import typer

from glovecal_service.cli.take.rows import find_takes
from glovecal_service.cli.terminal.connection import connect
from glovecal_service.cli.terminal.options import AsJson, Model
from glovecal_service.cli.terminal.printing import out, print_json, print_table
from glovecal_service.cli.terminal.waiting import wait_for_job

ERRORS = {"rotation": "rotation", "before": "error before (°)", "after": "after (°)"}
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
        rows = find_takes(service.get("/takes"), take or [])
        body: dict[str, Any] = {"effect": wanted, "rotations": rotation or None, "activate": activate}
        body["takes"] = [row["id"] for row in rows] or None
        job = service.post(f"/models/{model}/effects", body)["id"]
        result = wait_for_job(service, job, quiet=as_json)["result"]
    if as_json:
        print_json(result)
        return
    out.print(result["sentence"])
    rows = [
        {"rotation": name, "before": before, "after": result["after"].get(name)}
        for name, before in result["before"].items()
    ]
    print_table(rows, ERRORS, empty="")
    if result["model"] is None:
        out.print(f"Model {model[:12]} stays as it is; nothing was stored.")
    else:
        _say_child(result)
        out.print(f"Next: glovecal diagnose {result['model'][:12]}")


def remove_effect(model: Model, effect: Effect, activate: Activate = False, as_json: AsJson = False) -> None:
    """Take an effect out of a model: a child of it is learned without."""
    with connect() as service:
        query = {"activate": "true"} if activate else None
        job = service.delete(f"/models/{model}/effects/{quote(effect, safe='')}", query)["id"]
        result = wait_for_job(service, job, quiet=as_json)["result"]
    if as_json:
        print_json(result)
        return
    sentence = result["sentence"]
    out.print(sentence[:1].upper() + sentence[1:])
    _say_child(result)


def _say_child(result: dict[str, Any]) -> None:
    short = result["model"][:12]
    active = "Active." if result["active"] else f"Not active; glovecal model activate {short} makes it so."
    out.print(f"Model {short}, made from {result['parent'][:12]}. {active}")


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
