"""``glovecal compare`` and ``glovecal where``: models against takes with reference."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from glovecal_models.comparison.answer import EACH_POSE, SideBySide
from glovecal_models.comparison.where.answer import NOISE_FLOORS
from glovecal_service.cli.asking import Ceiling, wait_for_ceiling
from glovecal_service.cli.take.rows import named_takes, stored_takes
from glovecal_service.cli.terminal.connection import connect
from glovecal_service.cli.terminal.options import AsJson, Model, Models
from glovecal_service.cli.terminal.presenting import present
from glovecal_service.cli.terminal.printing import (
    Overwrite,
    Refusal,
    Report,
    fetch_report,
    out,
    print_json,
    read_or_print,
    require_place,
    write_report,
)
from glovecal_service.plain import read
from glovecal_service.questions.comparison import COMPARE, WHERE
from glovecal_service.rest.model.answer import ModelInFull

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


def compare(
    model: Models,
    take: HeldOutTakes = None,
    poses: Annotated[bool, typer.Option("--poses", help="Errors of each pose too.")] = False,
    offline: Annotated[
        bool,
        typer.Option(
            "--offline",
            help="Of angles estimated with both directions of time, as recordings can be; live ones beside.",
        ),
    ] = False,
    ceiling: Ceiling = False,
    report: Report = None,
    overwrite: Overwrite = False,
    as_json: AsJson = False,
) -> None:
    """Hold models against measurements; several models are shown side by side."""
    names = list(dict.fromkeys(model))
    results = _asked(COMPARE.kind, names, take, {"offline": offline}, ceiling, report, overwrite, as_json)
    if as_json:
        print_json(results)
        return
    found = [COMPARE.read(result) for result in results.values()]
    shown = found[0] if len(found) == 1 else SideBySide(found)
    present(shown.presentation(), EACH_POSE if poses else None)
    if poses and not any(item.poses for item in found):
        out.print("\nNo frame of these takes has the name of a pose.")


def where(
    model: Model,
    take: HeldOutTakes = None,
    floors: Annotated[
        bool, typer.Option("--floors", help="Every estimate of the noise floors, and how slow errors are.")
    ] = False,
    cross_validation: Annotated[
        bool,
        typer.Option(
            "--cross-validation",
            help="Also train two models on disjoint halves of the training takes, and show where they differ "
            "by more than they claim.",
        ),
    ] = False,
    ceiling: Ceiling = False,
    report: Report = None,
    overwrite: Overwrite = False,
    as_json: AsJson = False,
) -> None:
    """Say where a model fails: each rotation against its noise floor and every recorded column."""
    more = {"cross_validation": cross_validation}
    found = _asked(WHERE.kind, [model], take, more, ceiling, report, overwrite, as_json)[model]
    present(read_or_print(WHERE.answer, found, as_json).presentation(), NOISE_FLOORS if floors else None)


def _asked(
    kind: str,
    models: Sequence[str],
    wanted: Sequence[str] | None,
    more: dict[str, Any],
    ceiling: bool,
    report: Path | None,
    overwrite: bool,
    as_json: bool,
) -> dict[str, Any]:
    """The answer of each model, and a page of all written where one is wanted."""
    if report is not None:
        require_place(report, overwrite=overwrite)
    with connect() as service:
        compared = [read(ModelInFull, service.get(f"/models/{name}")) for name in models]
        takes = _takes(service, compared, wanted or [], else_trained_on=kind == WHERE.kind)
        for name in models if ceiling else ():
            wait_for_ceiling(service, name, quiet=as_json)
        body = {"takes": takes, **more}
        results = {name: service.post(f"/models/{name}/{kind}", body) for name in models}
        # The first of the models is looked at closely, the others stand beside it.
        asked = {"takes": takes, "beside": models[1:], "offline": more.get("offline", False)}
        page = fetch_report(service, f"/models/{models[0]}/report", asked, report) if report else b""
    if report is not None:
        write_report(report, page, as_json=as_json)
    return results


def _takes(
    service: RestClient, models: Sequence[ModelInFull], wanted: Sequence[str], *, else_trained_on: bool
) -> list[str]:
    """Ids of those named, else of all that none of the models was trained on.

    Raises Refusal when a name is unknown, or when nothing is left to test with, unless those
    ``else_trained_on`` will do.
    """
    if wanted:
        return [take.id for take in named_takes(service, list(wanted))]
    subject, layout = models[0].subject, models[0].layout
    rows = stored_takes(service, subject=subject, layout=layout, hand=models[0].hand)
    trained = {take for model in models for take in model.trained_on}
    measured = [row.id for row in rows if row.rotations]
    new = [take for take in measured if take not in trained]
    if not new and else_trained_on and measured:
        return measured
    if not new:
        raise Refusal(
            f"every take of {subject} with layout {layout} and reference angles was trained on, so none can "
            "test; name one with --take, or keep one from training with glovecal train --leave-out"
        )
    return new
