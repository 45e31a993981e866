"""``glovecal take``: recordings, from files or from the live glove."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from glovecal_client.errors import ServiceError
from glovecal_service.cli.take import (
    clocks,
    examination,
    hands,
    holds,
    latency,
    motion,
    table_import,
    time_code,
    video,
)
from glovecal_service.cli.take.rows import find_takes, named_take, named_takes, print_takes, stored_takes
from glovecal_service.cli.terminal.connection import connect
from glovecal_service.cli.terminal.listing import (
    AfterPlace,
    EveryRow,
    MostRows,
    Since,
    Wanted,
    Words,
    filtered,
)
from glovecal_service.cli.terminal.options import AsJson, OnlyLayout, OnlySubject, Take, identifier
from glovecal_service.cli.terminal.printing import (
    Overwrite,
    err,
    out,
    print_facts,
    print_table,
    read_or_print,
    require_place,
    write_whole,
)
from glovecal_service.plain import read
from glovecal_service.rest.take.answer import CameraReferenceView, CheckView
from glovecal_service.rest.take.answer import Take as TakeRow

if TYPE_CHECKING:
    from glovecal_client.rest import RestClient

app = typer.Typer(help="Takes: recordings with or without reference angles.", no_args_is_help=True)
app.command("import")(table_import.import_takes)
app.command("look")(table_import.look)
app.command("clocks")(clocks.clocks)
app.command("latency")(latency.latency)
app.command("examine")(examination.examine)
app.command("hands")(hands.hands)
app.command("holds")(holds.holds)
app.command("motion")(motion.motion)
app.command("timecode")(time_code.timecode)
app.command("video")(video.video)

JUMPS = {
    "rotation": "reference jumps",
    "start_s": "from (s)",
    "end_s": "to (s)",
    "rows": "rows",
    "size_deg": "by (deg)",
    "comes_back": "excluded",
}
CONFLICT = 409
"""The service's answer when a take is two tables."""
FORMATS = (".csv", ".parquet")


@app.command("list")
def list_takes(
    subject: OnlySubject = None,
    layout: OnlyLayout = None,
    text: Words = None,
    since: Since = None,
    limit: MostRows = None,
    every: EveryRow = False,
    after: AfterPlace = None,
    as_json: AsJson = False,
) -> None:
    """List takes, the newest last."""
    query = {"subject": subject, "layout": layout, "text": text, "since": since}
    wanted, command = Wanted(limit, every, after, as_json), filtered("take list", **query)
    with connect() as service:
        rows = wanted.rows(service, TakeRow, "/takes", command, query, newest_last=True)
    print_takes(rows, empty="No takes yet. Import some: glovecal take import FILE --subject NAME")


@app.command("check")
def check(take: Take, as_json: AsJson = False) -> None:
    """Show one take: how long, how regular, what was measured, what looks wrong."""
    with connect() as service:
        document = service.get(f"/takes/{_id(service, take)}/check")
    found = read_or_print(CheckView, document, as_json)
    print_facts(_facts(found))
    out.print()
    sensors = {"sensor": "sensor", "low": "lowest", "high": "highest", "changed": "changes"}
    print_table(found.sensors, sensors, empty="No sensors.")
    out.print()
    rotations = {
        "rotation": "rotation",
        "low_deg": "lowest (deg)",
        "high_deg": "highest (deg)",
        "rows": "rows",
    }
    print_table(found.rotations, rotations, empty="No reference angles: nothing to train on or compare with.")
    if found.jumps:
        out.print()
        print_table(found.jumps, JUMPS, empty="")
    for sentence in found.sentences:
        err.print(sentence, style="yellow")


def _facts(found: CheckView) -> dict[str, Any]:
    take, pre_roll_s, sent = found.take, found.pre_roll_s, found.take.sent
    return {
        "take": f"{take.id} {take.name}",
        "subject": take.subject,
        "layout": take.layout,
        "wearing": take.wearing,
        "simulated": take.simulated,
        "source": take.source,
        "added": take.created_at,
        "frames": f"{take.frames} in {take.duration_s:.2f} s",
        **({"pre-roll": f"{found.pre_roll_frames} of them in {pre_roll_s:.2f} s"} if pre_roll_s else {}),
        **({"note": take.note} if take.note else {}),
        **({"left out": _left_out(take)} if take.left_out else {}),
        **time_code.facts_of(found),
        "state": take.state,
        **({} if sent is None else {"frames sent": sent}),
        "rate (Hz)": found.rate_hz,
        "gaps": f"{found.gaps}, longest interval {found.longest_interval_s or 0:.3g} s",
        "repeated frames": f"{100 * found.repeated_frames:.0f} %",
        "with reference": f"{100 * found.frames_with_reference:.0f} % of the frames",
        "context": take.context,
    }


@app.command("reference")
def reference(
    take: Take,
    file: Annotated[
        Path, typer.Argument(exists=True, dir_okay=False, help="Table with time_s and r.* columns.")
    ],
    clock: Annotated[
        Literal["take", "wall"],
        typer.Option(help="What time_s counts. take: as in the take itself; wall: Unix seconds."),
    ] = "take",
) -> None:
    """Attach reference angles that were measured elsewhere to a recorded take."""
    with connect() as service:
        kept = read(TakeRow, service.attach_reference(_id(service, take), file, clock=clock))
        found = read(CheckView, service.get(f"/takes/{kept.id}/check"))
    out.print(
        f"Take {kept.name} now has {kept.reference_rows} reference rows; "
        f"{100 * found.frames_with_reference:.0f} % of its frames have a reference."
    )
    for sentence in found.sentences:
        err.print(sentence, style="yellow")


@app.command("camera")
def camera(
    take: Take,
    file: Annotated[
        Path,
        typer.Argument(exists=True, dir_okay=False, help="A camera's estimates (.npz), as it wrote them."),
    ],
    near: Annotated[
        float, typer.Option(help="Camera time less glove time, about; seconds.", show_default=True)
    ] = 0.0,
    within: Annotated[float, typer.Option(help="Search so far on both sides of it; seconds.")] = 3.0,
    as_json: AsJson = False,
) -> None:
    """Attach what a camera measured while the glove recorded as the take's reference."""
    with connect() as service:
        answer = service.attach_camera_reference(_id(service, take), file, near_s=near, within_s=within)
    for sentence in read_or_print(CameraReferenceView, answer, as_json).sentences:
        out.print(sentence)


@app.command("export")
def export(
    take: Take,
    file: Annotated[Path, typer.Argument(help="Where to write; .csv or .parquet.")],
    overwrite: Overwrite = False,
) -> None:
    """Write a take as a take table; two tables when its reference has a clock of its own."""
    if file.suffix.lower() not in FORMATS:
        raise typer.BadParameter(f"{file.name!r} must end in .csv or .parquet, the formats of a take table")
    with connect() as service:
        write_whole(_tables(service, take, file, overwrite))


def _tables(service: RestClient, take: str, file: Path, overwrite: bool) -> dict[Path, bytes]:
    path, table_format = f"/takes/{_id(service, take)}/export", file.suffix.lstrip(".").lower()
    try:
        whole = service.download(path, {"format": table_format})
    except ServiceError as error:
        if error.status != CONFLICT:
            raise
        stem = file.stem.removesuffix(".frames")
        parts = {part: file.with_name(f"{stem}.{part}{file.suffix}") for part in ("frames", "reference")}
        require_place(*parts.values(), overwrite=overwrite)
        return {
            name: service.download(path, {"format": table_format, "part": part})
            for part, name in parts.items()
        }
    require_place(file, overwrite=overwrite)
    return {file: whole}


@app.command("use-layout")
def use_layout(
    layout: Annotated[str, typer.Argument(help="The layout's name.", callback=identifier("layout"))],
    take: Annotated[
        list[str] | None, typer.Argument(help="Takes: names or ids. Default: all of the subject.")
    ] = None,
    subject: OnlySubject = None,
) -> None:
    """Read takes by another layout of the same sensors, such as one that take examine --keep made."""
    if not take and subject is None:
        raise typer.BadParameter("say which: TAKE ..., or all takes of a subject with --subject")
    with connect() as service:
        if take and subject is None:
            wanted = named_takes(service, take)
        else:
            rows = stored_takes(service, subject=subject)
            wanted = find_takes(rows, take) if take else rows
        for row in wanted:
            service.put(f"/takes/{row.id}/layout", {"layout": layout})
    out.print(f"Read by layout {layout} from now on: {', '.join(row.name for row in wanted) or 'no take'}.")


@app.command("note")
def note(
    take: Take, text: Annotated[str, typer.Argument(help='What is to be remembered; "" for nothing.')]
) -> None:
    """Note something of a take; the page Takes finds its words."""
    with connect() as service:
        row = read(TakeRow, service.put(f"/takes/{_id(service, take)}/note", {"note": text}))
    out.print(f"Take {row.name}: {row.note or 'no note'}.", highlight=False)


@app.command("leave-out")
def leave_out(
    take: Take,
    from_s: Annotated[
        float | None, typer.Option("--from", help="Begin of the stretch, seconds since the first frame.")
    ] = None,
    to_s: Annotated[float | None, typer.Option("--to", help="Its end.")] = None,
    undo: Annotated[
        bool, typer.Option("--undo", help="Use that stretch again; without --from and --to the last one.")
    ] = False,
) -> None:
    """Leave a stretch out of training, comparison and diagnosis, or use it again; stored data stay."""
    if (from_s is None) != (to_s is None) or (from_s is None and not undo):
        raise typer.BadParameter("say which stretch: --from SECONDS --to SECONDS")
    stretch = None if from_s is None else {"from_s": from_s, "to_s": to_s}
    with connect() as service:
        path = f"/takes/{_id(service, take)}/left-out"
        answer = service.post(f"{path}/undo", {"stretch": stretch}) if undo else service.post(path, stretch)
    row = read(TakeRow, answer)
    out.print(f"Take {row.name}: {_left_out(row) or 'nothing'} left out.")
    err.print("Existing models are unchanged; train again.")


def _left_out(take: TakeRow) -> str:
    return ", ".join(f"{low:.2f} to {high:.2f} s" for low, high in take.left_out)


@app.command("remove")
def remove(take: Take) -> None:
    """Remove a take that no model was trained on. The file it came from stays in the data folder."""
    with connect() as service:
        row = named_take(service, take)
        service.delete(f"/takes/{row.id}")
    out.print(f"Removed take {row.name} ({row.id}).")


def _id(service: RestClient, take: str) -> str:
    return named_take(service, take).id
