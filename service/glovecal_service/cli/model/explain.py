"""``glovecal explain``: what one frame's angles are made of."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from glovecal_service.cli.take.rows import find_take
from glovecal_service.cli.terminal.connection import connect
from glovecal_service.cli.terminal.options import AsJson, Model
from glovecal_service.cli.terminal.printing import out, print_json, print_table

COLUMNS = {"name": "term", "degrees": "degrees", "sd": "SD (deg)"}


def explain(
    model: Model,
    take: Annotated[str, typer.Option("--take", "-t", help="Take: its name or id.")],
    at: Annotated[float, typer.Option(help="Seconds by the take's clock; the nearest frame counts.")],
    rotation: Annotated[
        list[str] | None, typer.Option("--rotation", "-r", help="Only this rotation; repeat. Default: all.")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Say what an angle is made of: the base's value and what each effect adds, with standard deviations."""
    with connect() as service:
        document = service.get(f"/models/{model}")
        row = find_take(service.get("/takes", {"subject": document["subject"]}), take)
        body = {"take": row["id"], "at_s": at, "rotations": rotation or []}
        found = service.post(f"/models/{model}/explain", body)
    if as_json:
        print_json(found)
    else:
        _print(found, document["method"])


def _print(found: dict[str, Any], method: str) -> None:
    simulated = ", SIMULATED" if found["simulated"] else ""
    out.print(
        f"Model {found['model'][:12]} ({method}), take {found['name']} of {found['wearing']}{simulated}: "
        f"frame {found['frame']} at {found['time_s']:.3f} s."
    )
    for sentence in found["sentences"]:
        out.print(sentence)
    for item in found["rotations"]:
        readings = ", ".join(f"{name} {value:g}" for name, value in item["readings"].items())
        read = f", from raw readings {readings}" if readings else ""
        out.print(f"\n{item['rotation']}: {item['degrees']:.2f} degrees, SD {item['sd_deg']:.2f}{read}.")
        rows = [{"name": one["name"], "degrees": _degrees(one), "sd": _sd(one)} for one in item["terms"]]
        total = {"name": "angle", "degrees": f"{item['degrees']:.2f}", "sd": f"{item['sd_deg']:.2f}"}
        print_table([*rows, total], COLUMNS, empty="")
        for sentence in item["sentences"]:
            out.print(sentence)


def _degrees(term: dict[str, Any]) -> str:
    if term["kind"] in ("noise", "interval"):
        return ""
    return f"{term['degrees']:.2f}" if term["kind"] == "base" else f"{term['degrees']:+.2f}"


def _sd(term: dict[str, Any]) -> str:
    if term["sd_deg"] is not None:
        return f"{term['sd_deg']:.2f}"
    return "not stored" if term["variance_deg2"] is None else "less noise"
