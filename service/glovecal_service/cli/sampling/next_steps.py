"""``glovecal sample next``: what to record next for a model that is there."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from glovecal_service.cli.model.models import active_model
from glovecal_service.cli.terminal.connection import connect
from glovecal_service.cli.terminal.options import AsJson, OnlyLayout, OnlySubject, model_id
from glovecal_service.cli.terminal.printing import out, print_json, print_table

COLUMNS = {
    "name": "step",
    "needs": "needs",
    "seconds": "seconds",
    "teaches": "standard deviation (°)",
    "all": "all rotations (°)",
}
MOST_TAUGHT = 3


def next_steps(
    model: Annotated[
        str | None,
        typer.Argument(help="Model id, or its first 6 or more digits; or --subject.", callback=model_id),
    ] = None,
    subject: OnlySubject = None,
    layout: OnlyLayout = None,
    most: Annotated[int, typer.Option(min=1, max=200, help="Steps to show.")] = 5,
    as_json: AsJson = False,
) -> None:
    """Show which poses and motions reduce a model's uncertainty most for their time.

    With --subject: its active model. Nothing is recorded; to record: glovecal sample --protocol active.
    """
    with connect() as service:
        chosen = model or active_model(service, subject, layout)
        found = service.get(f"/models/{chosen}/next-steps", {"most": most})
    if as_json:
        print_json(found)
        return
    print_table([_row(step, found) for step in found["steps"]], COLUMNS, empty="")
    for sentence in found["sentences"]:
        out.print(sentence)
    if found["diagnosed"] is not None:
        wanted = found["diagnosed"]
        out.print(f"Also useful, {wanted['seconds']:g} s: {wanted['what']} {wanted['reason']}")


def _row(step: dict[str, Any], found: dict[str, Any]) -> dict[str, Any]:
    falls = sorted(
        step["sd_after_deg"], key=lambda rotation: step["sd_after_deg"][rotation] - step["sd_deg"][rotation]
    )
    told = [f"{name} {step['sd_deg'][name]:.1f} to {step['sd_after_deg'][name]:.1f}" for name in falls]
    return {
        "name": step["name"],
        "needs": step["needs"],
        "seconds": f"{step['seconds']:.1f}",
        "teaches": ", ".join(told[:MOST_TAUGHT]) + (" ..." if len(told) > MOST_TAUGHT else ""),
        "all": f"{found['rms_sd_deg']:.2f} to {step['rms_sd_after_deg']:.2f}",
    }
