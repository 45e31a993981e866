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
    service: RestClient,
    models: Sequence[dict[str, Any]],
    wanted: Sequence[str],
    *,
    else_trained_on: bool = False,
) -> list[dict[str, Any]]:
    """Rows of ``GET /takes``. Raises Refusal when a name is unknown, or when nothing is left to test with,
    unless those ``else_trained_on`` will do."""
    if wanted:
        return find_takes(service.get("/takes"), wanted)
    subject, layout = models[0]["subject"], models[0]["layout"]
    wanted_rows = {"subject": subject, "layout": layout, "hand": models[0]["hand"]}
    rows = service.get("/takes", {name: value for name, value in wanted_rows.items() if value})
    trained = {take["id"] for document in models for take in document["facts"].get("takes", [])}
    measured = [row for row in rows if row["rotations"]]
    rows = [row for row in measured if row["id"] not in trained]
    if not rows and else_trained_on and measured:
        return measured
    if not rows:
        raise Refusal(
            f"every take of {subject} with layout {layout} and reference angles was trained on, so none can "
            "test; name one with --take, or keep one from training with glovecal train --leave-out"
        )
    return rows


def warn_trained_on(model: str, trained_on: Sequence[str], takes: Sequence[dict[str, Any]]) -> None:
    """Say which of ``takes`` the model has seen before."""
    names = [row["name"] for row in takes if row["id"] in trained_on]
    if names:
        several = f"all {len(names)} takes" if len(names) == len(takes) else f"takes {', '.join(names)}"
        of = several if len(names) > 1 else f"take {names[0]}"
        err.print(
            f"Careful: model {model[:12]} was trained on {of}; this is not a held-out error.", style="yellow"
        )
