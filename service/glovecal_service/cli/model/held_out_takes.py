"""The takes a model is held against: those named, else all it was not trained on."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated, Any

import typer

from glovecal_service.cli.take.rows import find_takes
from glovecal_service.cli.terminal.printing import err
from glovecal_service.cli.terminal.refusal import Refusal

if TYPE_CHECKING:
    from glovecal_client.rest import RestClient

HeldOutTakes = Annotated[
    list[str] | None,
    typer.Option(
        "--take",
        "-t",
        help="Take to compare with; repeat. Default: all that none of them was trained on.",
    ),
]


def held_out_takes(
    service: RestClient, models: Sequence[dict[str, Any]], wanted: Sequence[str]
) -> list[dict[str, Any]]:
    """Rows of ``GET /takes``. Raises Refusal when a name is unknown, or when nothing is left to test with."""
    if wanted:
        return find_takes(service.get("/takes"), wanted)
    subject, layout = models[0]["subject"], models[0]["layout"]
    rows = service.get("/takes", {"subject": subject, "layout": layout})
    trained = {take["id"] for document in models for take in document["facts"].get("takes", [])}
    rows = [row for row in rows if row["rotations"] and row["id"] not in trained]
    if not rows:
        raise Refusal(
            f"every take of {subject} with layout {layout} and reference angles was trained on, so none can "
            "test; name one with --take, or keep one from training with glovecal train --leave-out"
        )
    return rows


def warn_trained_on(model: str, trained_on: Sequence[str], takes: Sequence[dict[str, Any]]) -> None:
    """Say which of ``takes`` the model has seen before."""
    names = {row["id"]: row["name"] for row in takes}
    for id in trained_on:
        err.print(
            f"Careful: model {model[:12]} was trained on take {names[id]}; this is not a held-out error.",
            style="yellow",
        )
