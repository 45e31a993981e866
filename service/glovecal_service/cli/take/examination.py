"""``glovecal take examine``: which sensors stretch which others, and how each rotation should be read."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated, Any

import typer

from glovecal_models.independence.answer import Independence
from glovecal_service.cli.take.rows import find_take, find_takes, only_layout, stored_takes
from glovecal_service.cli.terminal.connection import connect
from glovecal_service.cli.terminal.options import AsJson, OnlyLayout, OnlySubject, identifier
from glovecal_service.cli.terminal.presenting import present
from glovecal_service.cli.terminal.printing import (
    Overwrite,
    Refusal,
    Report,
    err,
    fetch_report,
    out,
    print_json,
    require_place,
    write_report,
)
from glovecal_service.plain import read
from glovecal_service.questions.examination import QUESTION
from glovecal_service.rest.glove.answer import LayoutView

if TYPE_CHECKING:
    from glovecal_client.rest import RestClient


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
        document = service.post("/takes/examination", body | ({"layout_name": keep} if keep else {}))
        answer = QUESTION.read(document)
        page = fetch_report(service, "/takes/examination/report", body, report) if report else b""
        kept = _kept(service, answer, keep, rotation) if keep is not None else None
    if report is not None:
        write_report(report, page, as_json=as_json)
    if as_json:
        print_json(document)
    else:
        present(answer.presentation())
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
    rows = stored_takes(service, subject=subject, layout=layout)
    named = {}
    for pair in still:
        name, equals, rotation = pair.rpartition("=")
        if not equals:
            raise typer.BadParameter(f"{pair!r} does not say which rotation: write TAKE=ROTATION")
        named[find_take(rows, name).id] = rotation
    examined = [row for row in rows if row.name.lower().startswith("still") or row.id in named]
    chosen = find_takes(rows, wanted) if wanted else examined
    if not chosen:
        raise Refusal(
            "there is no take called still-...; keep a joint still, move the others, and record it: "
            "glovecal record GLOVE still-IM_ABD --seconds 30"
        )
    only_layout(chosen)
    body: dict[str, Any] = {"takes": [row.id for row in chosen], "still": named}
    if ranges is not None:
        body |= {"range_takes": [row.id for row in find_takes(rows, ranges)]}
    return body


def _kept(service: RestClient, found: Independence, name: str, rotations: Sequence[str] | None) -> str:
    from glovecal_models.independence.independence import proposed_layout
    from glovecal_models.layout import Layout

    before = Layout.from_document(read(LayoutView, service.get(f"/gloves/{found.layout}")).document)
    kept = proposed_layout(before, found.proposals, name, rotations)
    changed = [
        item.rotation
        for item in kept.correspondences
        if item.sensors != before.correspondence(item.rotation).sensors
    ]
    service.put(f"/gloves/{name}", kept.to_document())
    if not changed:
        return f"Kept layout {name}; it reads every rotation alike as {found.layout}."
    return (
        f"Kept layout {name}: unlike {found.layout} it reads {', '.join(changed)} otherwise. Train with it: "
        f"glovecal take use-layout {name} TAKE ..."
    )
