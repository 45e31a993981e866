"""``glovecal ceiling``: whether anything is left to gain from what was recorded."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Annotated, Any

import typer

from glovecal_service.cli.take.rows import find_takes
from glovecal_service.cli.terminal.connection import connect
from glovecal_service.cli.terminal.options import AsJson, Model
from glovecal_service.cli.terminal.printing import err, out, print_json, print_table
from glovecal_service.cli.terminal.waiting import wait_for_job

if TYPE_CHECKING:
    from glovecal_client.rest import RestClient

Ceiling = Annotated[
    bool, typer.Option("--ceiling", help="Ask whether anything is left to gain from what was recorded.")
]
COLUMNS = {
    "rotation": "rotation",
    "rmse_deg": "error",
    "ceiling_deg": "ceiling",
    "lowest_deg": "at least",
    "p_value": "p",
}
LEGEND = (
    "Error on left-out quarters of the takes, in degrees. ceiling: what a black box on everything recorded "
    "leaves of it; at least: with the upper 95 % bound of its gain; p: by flipping the sign of whole takes. "
    "The box is never served."
)


def ceiling(
    model: Model,
    take: Annotated[
        list[str] | None,
        typer.Option("--take", "-t", help="Take to ask; repeat. Default: those it was trained on."),
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Of trees and controls.")] = 0,
    as_json: AsJson = False,
) -> None:
    """Find whether a model leaves anything to gain, or the recorded sensors do not know more.

    The model is trained again without each quarter of the takes, and a black box predicts its error from all
    readings and their history, context, wearing and time. compare, where and diagnose show the answer then.
    """
    with connect() as service:
        found = wait_for_ceiling(service, model, take or [], seed, quiet=as_json)
    if as_json:
        print_json(found)
        return
    rows = [{"rotation": name, **gain} for name, gain in found["rotations"].items()]
    if found["overall"] is not None:
        rows.insert(0, {"rotation": "all", **found["overall"]})
        print_table(rows, COLUMNS, empty="")
        err.print(LEGEND)
    print_ceiling(found)


def wait_for_ceiling(
    service: RestClient, model: str, takes: Sequence[str] = (), seed: int = 0, *, quiet: bool = False
) -> dict[str, Any]:
    """The result of a ``ceiling`` job; at once where it was asked for before."""
    ids = [row["id"] for row in find_takes(service.get("/takes"), takes)] if takes else None
    job = service.post(f"/models/{model}/ceiling", {"takes": ids, "seed": seed})["id"]
    return wait_for_job(service, job, quiet=quiet)["result"]


def print_ceiling(found: Mapping[str, Any] | None) -> None:
    if found is not None:
        out.print(f"\n{found['sentence']}")
