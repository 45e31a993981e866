"""``glovecal take examine``: which sensors stretch which others, and how each rotation should be read."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from glovecal_models.names import did_you_mean
from glovecal_service.cli.take.rows import find_take, find_takes
from glovecal_service.cli.terminal.connection import connect
from glovecal_service.cli.terminal.options import AsJson, OnlyLayout, OnlySubject, identifier
from glovecal_service.cli.terminal.printing import err, out, print_json, print_table
from glovecal_service.cli.terminal.refusal import Refusal
from glovecal_service.cli.terminal.writing import Overwrite, Report, require_place, write_report

if TYPE_CHECKING:
    from glovecal_client.rest import RestClient

COLUMNS = {
    "rotation": "kept still",
    "std": "std. dev.",
    "max": "max. dev.",
    "coupled": "cross-coupled",
    "affecting": "affecting sensors (std., max. dev. of their own)",
}
LEGEND = (
    "Per cent of the joint's active range, as its sensor reads it. Cross-coupled from {std:g} % standard or "
    "{max:g} % largest deviation on; ? undecided, - below."
)


def examine(
    take: Annotated[
        list[str] | None, typer.Argument(help="Takes: names or ids. Default: all that are called still-...")
    ] = None,
    subject: OnlySubject = None,
    layout: OnlyLayout = None,
    still: Annotated[
        list[str] | None,
        typer.Option(
            help="TAKE=ROTATION: what was kept still, where the take's name does not say it; repeat."
        ),
    ] = None,
    range_take: Annotated[
        list[str] | None,
        typer.Option(
            "--range",
            help="Take in which joints go through their ranges; repeat. Default: the subject's others.",
        ),
    ] = None,
    keep: Annotated[
        str | None,
        typer.Option(
            "--keep", help="Store what is proposed as a layout of this name.", callback=identifier("layout")
        ),
    ] = None,
    rotation: Annotated[
        list[str] | None,
        typer.Option(
            help="Keep the proposal for this rotation, also an unsure one; repeat. Default: all sure."
        ),
    ] = None,
    report: Report = None,
    overwrite: Overwrite = False,
    as_json: AsJson = False,
) -> None:
    """Examine which sensors others stretch: in each take one rotation is kept still while others move.

    Call takes still-IM_ABD; still-IM_ABD-move-I_MCP when only that one moves, and range-IM_ABD when only that
    one goes through its range: then each per cent is the surest.
    """
    if report is not None:
        require_place(report, overwrite=overwrite)
    if rotation and keep is None:
        raise typer.BadParameter("--rotation chooses what --keep keeps; give both")
    with connect() as service:
        body = _body(service, take or [], subject, layout, still or [], range_take)
        found = service.post("/takes/examination", body | ({"layout_name": keep} if keep else {}))
        page = service.page("/takes/examination/report", body) if report is not None else ""
        kept = _kept(service, found, keep, rotation) if keep is not None else None
    if report is not None:
        write_report(report, page.encode(), as_json=as_json)
    if as_json:
        print_json(found)
    else:
        _print(found)
    if kept is not None:
        (err if as_json else out).print(kept)


def _body(
    service: RestClient,
    wanted: list[str],
    subject: str | None,
    layout: str | None,
    still: list[str],
    ranges: list[str] | None,
) -> dict[str, Any]:
    query = {key: value for key, value in {"subject": subject, "layout": layout}.items() if value}
    rows = service.get("/takes", query)
    named = {}
    for pair in still:
        name, equals, rotation = pair.rpartition("=")
        if not equals:
            raise typer.BadParameter(f"{pair!r} does not say which rotation: write TAKE=ROTATION")
        named[find_take(rows, name)["id"]] = rotation
    examined = [row for row in rows if row["name"].lower().startswith("still") or row["id"] in named]
    chosen = find_takes(rows, wanted) if wanted else examined
    if not chosen:
        raise Refusal(
            "there is no take called still-...; keep a joint still, move the others, and record it: "
            "glovecal record GLOVE still-IM_ABD --seconds 30"
        )
    layouts = sorted({row["layout"] for row in chosen})
    if len(layouts) > 1:
        raise Refusal(f"the takes have layouts {', '.join(layouts)}; choose one with --layout")
    body: dict[str, Any] = {"takes": [row["id"] for row in chosen], "still": named}
    if ranges is not None:
        body["range_takes"] = [row["id"] for row in find_takes(rows, ranges)]
    return body


def _kept(service: RestClient, found: dict[str, Any], name: str, rotations: list[str] | None) -> str:
    from glovecal_models.layout import Layout

    document = _with_proposals(found, name, rotations) if rotations else found["proposed_layout"]
    before = service.get(f"/gloves/{found['layout']}")["document"]
    changed = [
        rotation
        for rotation, sensors in document["rotations"].items()
        if sensors != before["rotations"].get(rotation)
    ]
    service.put(f"/gloves/{name}", Layout.from_document(document).to_document())
    differs = f"it reads {', '.join(changed)} otherwise" if changed else "it reads every rotation alike"
    return (
        f"Kept layout {name}: unlike {found['layout']} {differs}. Train with it: glovecal take use-layout "
        f"{name} TAKE ..."
        if changed
        else f"Kept layout {name}; {differs} as {found['layout']}."
    )


def _with_proposals(found: dict[str, Any], name: str, rotations: list[str]) -> dict[str, Any]:
    """The present layout with the proposals for ``rotations`` alone."""
    by_rotation = {item["rotation"]: item for item in found["proposals"] if item["is_sure"] is not None}
    unknown = [rotation for rotation in rotations if rotation not in by_rotation]
    if unknown:
        meant = did_you_mean(unknown[0], by_rotation, there="examined were")
        raise Refusal(f"there is no proposal for {unknown[0]!r}; {meant}")
    document = found["proposed_layout"]
    sensors = {
        item["rotation"]: item["sensors_now"] for item in found["proposals"] if item["kind_now"] != "0S1R"
    }
    kinds = {item["rotation"]: item["kind_now"] for item in found["proposals"]}
    for rotation in rotations:
        sensors[rotation] = by_rotation[rotation]["sensors"]
        kinds[rotation] = by_rotation[rotation]["kind"]
    palm = [rotation for rotation, kind in kinds.items() if kind == "MSMR"]
    return document | {"name": name, "rotations": sensors, "palm": palm}


def _print(found: dict[str, Any]) -> None:
    rows = [
        {
            "rotation": item["rotation"],
            "std": f"{item['std_pct']:.1f} %",
            "max": f"{item['max_pct']:.1f} %",
            "coupled": item["is_coupled"],
            "affecting": ", ".join(_share(share) for share in item["affecting"]) or "none",
        }
        for item in found["rotations"]
    ]
    print_table(rows, COLUMNS, empty="No rotation could be examined.")
    if rows:
        out.print(LEGEND.format(std=found["rule"]["std_pct"], max=found["rule"]["max_pct"]))
    for item in found["one_way"]:
        out.print(item["sentence"])
    out.print("\nProposed:")
    for item in found["proposals"]:
        if item["is_sure"] is not None:
            mark = (
                "" if not item["is_change"] else " (a change)" if item["is_sure"] else " (a change, unsure)"
            )
            out.print(f"  {item['sentence']}{mark}")
    left = [item["rotation"] for item in found["proposals"] if item["is_sure"] is None]
    if left:
        out.print(f"  As before, since not examined: {', '.join(left)}.")
    if any(item["is_change"] for item in found["proposals"]):
        out.print("\nTo keep it: the same command with --keep NAME, and --rotation for some of it.")
    for sentence in found["sentences"]:
        err.print(sentence, style="yellow")


def _share(share: dict[str, Any]) -> str:
    mark = {"yes": "", "undecided": "?", "no": "-"}[share["affects"]]
    return f"{share['sensor']}{mark} ({share['std_pct']:.1f} %, {share['max_pct']:.1f} %)"
