"""``glovecal sample next``: what to record next for a model that is there."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from glovecal_service.cli.model.models import active_model
from glovecal_service.cli.terminal.connection import connect
from glovecal_service.cli.terminal.options import AsJson, OnlyLayout, OnlySubject, model_id
from glovecal_service.cli.terminal.printing import out, print_table, read_or_print
from glovecal_service.rest.sampling.answer import NextStepsView, ProposedStepView

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
        document = service.get(f"/models/{chosen}/next-steps", {"most": most})
    found = read_or_print(NextStepsView, document, as_json)
    print_table([_row(step, found.rms_sd_deg) for step in found.steps], COLUMNS, empty="")
    for sentence in found.sentences:
        out.print(sentence)
    wanted = found.diagnosed
    if wanted is not None:
        out.print(f"Also useful, {wanted.seconds:g} s: {wanted.what} {wanted.reason}")


def _row(step: ProposedStepView, rms_sd_deg: float) -> dict[str, Any]:
    before, after = step.sd_deg, step.sd_after_deg
    falls = sorted(after, key=lambda rotation: after[rotation] - before[rotation])
    told = [f"{name} {before[name]:.1f} to {after[name]:.1f}" for name in falls]
    return {
        "name": step.name,
        "needs": step.needs,
        "seconds": f"{step.seconds:.1f}",
        "teaches": ", ".join(told[:MOST_TAUGHT]) + (" ..." if len(told) > MOST_TAUGHT else ""),
        "all": f"{rms_sd_deg:.2f} to {step.rms_sd_after_deg:.2f}",
    }
