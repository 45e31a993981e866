"""``glovecal take holds``: what readings do while a pose is held; needs no model and no angles."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from glovecal_service.cli.take.rows import find_takes
from glovecal_service.cli.terminal.connection import connect
from glovecal_service.cli.terminal.options import AsJson, OnlyLayout, OnlySubject
from glovecal_service.cli.terminal.printing import out, print_json, print_table
from glovecal_service.cli.terminal.refusal import Refusal

COLUMNS = {
    "pose": "pose",
    "holds": "holds",
    "duration_s": "seconds",
    "sensor": "sensor",
    "change": "change (% of span)",
    "same": "same sign",
    "tau": "time constant (s)",
}


def holds(
    take: Annotated[
        list[str] | None, typer.Argument(help="Takes: names or ids. Default: all of the subject.")
    ] = None,
    subject: OnlySubject = None,
    layout: OnlyLayout = None,
    as_json: AsJson = False,
) -> None:
    """Show how readings drift while a pose is held: creep, a hand that relaxes, or warm-up."""
    wanted = {key: value for key, value in {"subject": subject, "layout": layout}.items() if value}
    with connect() as service:
        rows = service.get("/takes", wanted)
        rows = find_takes(rows, take) if take else rows
        if not rows:
            raise Refusal("there is no take to look at; import some with glovecal take import")
        layouts = sorted({row["layout"] for row in rows})
        if len(layouts) > 1:
            raise Refusal(f"the takes have layouts {', '.join(layouts)}; choose one with --layout")
        found = service.post("/takes/holds", {"takes": [row["id"] for row in rows]})
    if as_json:
        print_json(found)
        return
    if found["poses"]:
        print_table(_rows(found), COLUMNS, empty="")
        out.print()
    out.print(found["sentence"])
    following = found["next_take"]
    if following:
        out.print(f"\nTo decide, record {following['seconds']} s: {following['what']}")


def _rows(found: dict[str, Any]) -> list[dict[str, Any]]:
    return [
        {
            "pose": pose["pose"],
            "holds": pose["holds"],
            "duration_s": f"{pose['duration_s']:.0f}",
            "sensor": name,
            "change": f"{drift['change_pct']:+.1f}",
            "same": f"{drift['same_sign_holds']} of {pose['holds']}",
            "tau": _time_constant(pose),
        }
        for pose in found["poses"]
        for name, drift in pose["sensors"].items()
    ]


def _time_constant(pose: dict[str, Any]) -> str:
    return f"> {pose['duration_s']:.0f}" if pose["tau_is_lower_bound"] else f"{pose['tau_s']:.2g}"
