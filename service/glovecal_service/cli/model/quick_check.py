"""``glovecal quick-check``: put a stored calibration right for a new wearing, with a few held poses."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from glovecal_service.cli.model.models import active_model
from glovecal_service.cli.take.rows import find_takes
from glovecal_service.cli.terminal.connection import connect
from glovecal_service.cli.terminal.options import AsJson, OnlyLayout, OnlySubject, model_id
from glovecal_service.cli.terminal.printing import out, print_json, print_table

if TYPE_CHECKING:
    pass

POSES = {"pose": "pose", "angles": "angles", "before_deg": "error (°)", "held_out_deg": "held out (°)"}
SENSORS = {
    "sensor": "sensor",
    "readings": "reads more by",
    "sd_readings": "±",
    "degrees": "that is (°)",
    "sd_degrees": "± (°)",
    "prior": "± before",
}
ROTATIONS = {
    "rotation": "rotation",
    "offset_deg": "shift (°)",
    "offset_sd_deg": "± (°)",
    "prior_sd_deg": "± before",
    "expected_now_deg": "error before (°)",
    "expected_after_deg": "after (°)",
    "full_calibration_deg": "full calibration (°)",
}


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
        rows = find_takes(service.get("/takes"), take)
        body = {"takes": [row["id"] for row in rows], "activate": activate}
        found = service.post(f"/models/{chosen}/quick-check", body)
    if as_json:
        print_json(found)
    else:
        _print(found)


def _print(found: dict[str, Any]) -> None:
    out.print(f"Wearing {found['wearing']}:")
    print_table([{**pose, "angles": _angles(pose)} for pose in found["poses"]], POSES, empty="")
    for item in found["refused"]:
        out.print(f"Not used: {item['pose']}: {item['reason']}.")
    out.print()
    sensors = [{**item, "prior": item["prior_sd_readings"]} for item in found["sensors"]]
    print_table(sensors, SENSORS, empty="")
    out.print()
    print_table(found["rotations"], ROTATIONS, empty="")
    out.print()
    for sentence in found["sentences"]:
        out.print(sentence)
    short = found["model"][:12]
    active = "Active." if found["active"] else f"Not active; glovecal model activate {short} makes it so."
    out.print(f"Model {short}, made from {found['parent'][:12]}. {active}")


def _angles(pose: dict[str, Any]) -> str:
    parts = [(pose["measured"], "measured"), (pose["by_name"], "by name")]
    told = ", ".join(f"{count} {how}" for count, how in parts if count)
    return f"{told}; saturated: {', '.join(pose['saturated'])}" if pose["saturated"] else told
