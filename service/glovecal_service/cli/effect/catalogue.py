"""``glovecal effects``: the catalogue of physical causes that a calibration can know."""

from __future__ import annotations

from typing import Annotated, Any
from urllib.parse import quote

import typer

from glovecal_service.cli.terminal.connection import connect
from glovecal_service.cli.terminal.options import AsJson
from glovecal_service.cli.terminal.printing import (
    err,
    out,
    print_facts,
    print_table,
    read_or_print,
)
from glovecal_service.rest.effect.answer import CatalogueEffect

COLUMNS = {
    "shown": "effect",
    "does": "what it does",
    "needs": "needs",
    "explanation": "in a sentence",
}
DOES = {
    "correction": "corrects",
    "repair": "repairs",
    "interval": "widens",
    "finding": "is found",
    "nothing": "-",
}
LEGEND = (
    "corrects: adds to the prediction (glovecal add-effect); repairs: mends the reference; is found: says "
    "where a recording lost something; needs: context columns of the takes. * brought by a package of yours."
)


def effects(
    name: Annotated[str | None, typer.Argument(help="One effect in full.")] = None, as_json: AsJson = False
) -> None:
    """List the physical effects that a calibration can know, or show one in full."""
    with connect() as service:
        found = service.get("/effects" if name is None else f"/effects/{quote(name, safe='')}")
    if name is not None:
        _print_one(read_or_print(CatalogueEffect, found, as_json))
        return
    rows = [_row(item) for item in read_or_print(list[CatalogueEffect], found, as_json)]
    print_table(rows, COLUMNS, empty="There are none.")
    err.print(LEGEND)


def _row(item: CatalogueEffect) -> dict[str, Any]:
    return {
        "shown": item.name + ("*" if item.own else ""),
        "does": DOES.get(item.kind, item.kind),
        "needs": [f"c.{name}" for name in item.context],
        "explanation": item.explanation,
    }


def _print_one(item: CatalogueEffect) -> None:
    print_facts(
        {
            "effect": item.name,
            "in a sentence": item.explanation,
            "what it does": DOES.get(item.kind, item.kind),
            "needs": [f"c.{name}" for name in item.context],
            "remembers": item.has_memory,
            "control": item.control,
            "source": item.source,
            "comes with": f"{item.package} (your own)" if item.own else item.package,
        }
    )
    if item.parameters:
        out.print("\nSearched for, beside weights:")
        columns = {"name": "parameter", "unit": "unit", "low": "from", "high": "to", "prior": "known before"}
        print_table(item.parameters, columns, empty="")
