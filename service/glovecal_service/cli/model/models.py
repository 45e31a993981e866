"""``glovecal model``: a subject's calibration models, and the one that predicts live."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from glovecal_models.calibration.answer import ModelEffect
from glovecal_service.cli.asking import verb
from glovecal_service.cli.model.vendor_files import (
    VendorFormat,
    exported_calibration,
    imported_calibration,
    print_left_out,
)
from glovecal_service.cli.terminal.connection import connect, stored_models
from glovecal_service.cli.terminal.listing import (
    AfterPlace,
    EveryRow,
    MostRows,
    Since,
    Wanted,
    Words,
    filtered,
)
from glovecal_service.cli.terminal.options import (
    AsJson,
    Model,
    OnlyHand,
    OnlyLayout,
    OnlySubject,
    Subject,
    subject_named,
)
from glovecal_service.cli.terminal.printing import (
    Overwrite,
    Refusal,
    err,
    out,
    print_facts,
    print_json,
    print_sentences,
    print_table,
    read_or_print,
    require_place,
    write_whole,
)
from glovecal_service.plain import read
from glovecal_service.questions.calibration_report import CALIBRATION_REPORT
from glovecal_service.rest.model.answer import ActivationView, ImportedModel, ModelInFull, Rotation
from glovecal_service.rest.model.answer import Model as ModelRow

if TYPE_CHECKING:
    from glovecal_client.rest import RestClient

WhoseModel = typer.Option(
    "--subject", "-s", help="Whose model it is; else whom it names.", callback=subject_named
)

app = typer.Typer(help="Calibration models: versions, activation, export, import.", no_args_is_help=True)
app.command("report")(verb(CALIBRATION_REPORT))


@app.command("list")
def list_models(
    subject: OnlySubject = None,
    layout: OnlyLayout = None,
    text: Words = None,
    since: Since = None,
    limit: MostRows = None,
    every: EveryRow = False,
    after: AfterPlace = None,
    as_json: AsJson = False,
) -> None:
    """List models, the newest last; the active one of each subject, layout and hand is marked."""
    query = {"subject": subject, "layout": layout, "text": text, "since": since}
    wanted, command = Wanted(limit, every, after, as_json), filtered("model list", **query)
    with connect() as service:
        rows = wanted.rows(service, ModelRow, "/models", command, query, newest_last=True)
    shown = [
        {**vars(row), "short": row.short, "method": _method(row), "errors": _errors(row)} for row in rows
    ]
    columns = {
        "short": "model",
        "subject": "subject",
        "layout": "layout",
        **({"hand": "hand"} if any(row.hand for row in rows) else {}),
        **({"name": "name"} if any(row.name for row in rows) else {}),
        "method": "method",
        "errors": "error (°)",
        "active": "active",
        "created_at": "trained",
    }
    print_table(shown, columns, empty="No models yet. Train one: glovecal train --subject NAME")
    if any(row.rmse_unseen_wearing_deg is not None for row in rows):
        out.print("Errors: in a wearing not seen / in wearings seen.")
    for row in rows:
        if row.damage:
            err.print(f"Damaged: {row.damage}", style="red")


@app.command("name")
def name(
    model: Model,
    text: Annotated[str, typer.Argument(help="What people call it; empty for nothing.")],
    note: Annotated[str, typer.Option(help="What is to be remembered of it.")] = "",
) -> None:
    """Give a model a name and a note."""
    with connect() as service:
        row = read(ModelRow, service.put(f"/models/{model}/name", {"name": text, "note": note}))
    out.print(f"Model {row.short} of {row.subject} is called {row.name}." if row.name else "It has no name.")


@app.command("remove")
def remove(model: Model) -> None:
    """Leave a model out of lists. What was made of it stays; `model restore` undoes it."""
    with connect() as service:
        row = read(ModelRow, service.delete(f"/models/{model}"))
    out.print(f"Removed model {row.short} of {row.subject}. To undo: glovecal model restore {row.short}")


@app.command("restore")
def restore(model: Model) -> None:
    """Undo the removal of a model."""
    with connect() as service:
        row = read(ModelRow, service.post(f"/models/{model}/restore"))
    out.print(f"Model {row.short} of {row.subject} is back; it is not active.")


@app.command("show")
def show(model: Model, as_json: AsJson = False) -> None:
    """Show one model: errors of each rotation, effects, takes, lineage."""
    with connect() as service:
        document = service.get(f"/models/{model}")
        found = read(ModelInFull, document)
        lineage = read(list[ModelRow], service.get(f"/models/{found.id}/lineage"))
    if as_json:
        print_json({**document, "lineage": [row.id for row in lineage]})
        return
    print_facts(_facts(found, lineage))
    print_sentences(found.unseen_wearing.sentences if found.unseen_wearing else ())
    out.print()
    columns = {
        "rotation": "rotation",
        "kind": "kind",
        "method": "method",
        "held_out_rmse_deg": "error (°)",
        "noise_deg": "noise (°)",
        "samples": "samples",
        "sensors": "sensors",
    }
    print_table(found.rotations, columns, empty="No rotations.")
    lines = line_rows(found.rotations)
    if lines:
        out.print()
        out.print("Lines: angle = scale x reading + ... + offset")
        print_table(lines, LINE_COLUMNS, empty="")
    tried = kernel_rows(found.rotations)
    if tried:
        out.print()
        out.print("Kernels tried: errors on takes left out, evidence over the first")
        print_table(tried, KERNEL_COLUMNS, empty="")
        for row in found.rotations:
            if row.kernel_choice:
                err.print(row.kernel_choice.sentence)
    if found.effect_details:
        out.print()
        print_table(effect_rows(found.effect_details), EFFECT_COLUMNS, empty="")


def _errors(row: ModelRow) -> str | float | None:
    """In a wearing not seen, then in those seen, where both are known."""
    unseen, seen = row.rmse_unseen_wearing_deg, row.held_out_rmse_deg
    return seen if unseen is None or seen is None else f"{unseen:.2f} / {seen:.2f}"


def _method(row: ModelRow) -> str:
    """The regressors and the effects on top of them."""
    effects = ", ".join(dict.fromkeys(row.effects))
    return f"{row.method} + {effects}" if effects else row.method


def _facts(found: ModelInFull, lineage: list[ModelRow]) -> dict[str, Any]:
    return {
        "model": found.id,
        "subject": found.subject,
        "layout": found.layout,
        "hand": found.hand,
        "method": found.method,
        "active": found.active,
        "error (°)": found.held_out_rmse_deg,
        "estimated on": found.error_estimate.get("how"),
        "trained on": list(found.trained_on.values()),
        "simulated": found.simulated,
        "trained": found.created_at,
        "made from": [row.short for row in lineage[1:]],
    }


@app.command("activate")
def activate(model: Model) -> None:
    """Predict live with this model from the next frame on."""
    with connect() as service:
        found = read(ActivationView, service.post(f"/models/{model}/activate"))
    out.print(f"Model {found.model[:12]} is active for {found.subject}, {found.layout}.")


@app.command("refine")
def refine(
    model: Model,
    rotation: Annotated[str, typer.Option("--rotation", "-r", help="Which, such as I_PIP.")],
    scale: Annotated[float, typer.Option("--scale", help="Times the angle.")] = 1.0,
    offset: Annotated[float, typer.Option("--offset", help="Added after it, degrees.")] = 0.0,
    activate: Annotated[bool, typer.Option("--activate", help="Predict live with it at once.")] = False,
) -> None:
    """Turn scale and offset of one rotation by hand: a new version, of a model that is a line there.

    Its error is not measured. `glovecal model rollback` takes back what was activated.
    """
    with connect() as service:
        body = {"rotations": {rotation: {"scale": scale, "offset_deg": offset}}, "activate": activate}
        child = read(ModelRow, service.post(f"/models/{model}/refine", body))
    out.print(f"Model {child.short} of {child.subject}: {child.sentences[0]}")
    if not activate:
        out.print(f"  glovecal model activate {child.short}")


@app.command("rollback")
def rollback(subject: Subject, layout: OnlyLayout = None, hand: OnlyHand = None) -> None:
    """Return to the model that was active before. Layout and hand are needed only if there are several."""
    with connect() as service:
        wanted = {"subject": subject, "layout": layout or _only_layout(service, subject), "hand": hand}
        found = read(ActivationView, service.post("/models/rollback", wanted))
    out.print(f"Model {found.model[:12]} is active again for {subject}, {found.layout}.")


def _only_layout(service: RestClient, subject: str) -> str:
    service.get(f"/subjects/{subject}")
    layouts = sorted({row.layout for row in stored_models(service, subject=subject)})
    if len(layouts) > 1:
        raise Refusal(f"subject {subject} has models of {', '.join(layouts)}; choose one with --layout")
    if not layouts:
        raise Refusal(f"subject {subject} has no models; train one: glovecal train --subject {subject}")
    return layouts[0]


@app.command("export")
def export(
    model: Model,
    file: Annotated[Path, typer.Argument(help="Where to write the artifact (.safetensors).")],
    overwrite: Overwrite = False,
    form: VendorFormat = None,
) -> None:
    """Write the model's artifact (safetensors with its manifest inside); its sha256 is the model's id.

    With --format it is written for another program, where the model is linear.
    """
    require_place(file, overwrite=overwrite)
    if form is not None:
        with connect() as service:
            written = exported_calibration(service, model, form)
        write_whole({file: written.text.encode()})
        print_left_out(written.left_out)
        return
    with connect() as service:
        write_whole({file: service.download(f"/models/{model}/export")})
    err.print(f"In Python: glovecal_models.calibration.artifact.load(open({str(file)!r}, 'rb').read())")


@app.command("import")
def import_model(
    file: Annotated[
        Path,
        typer.Argument(help="Of `model export`, or of another program.", exists=True, dir_okay=False),
    ],
    subject: Annotated[
        str | None,
        typer.Option(
            "--subject", "-s", help="Whose model it is; else whom it names.", callback=subject_named
        ),
    ] = None,
    create_subject: Annotated[
        bool, typer.Option("--create-subject", help="Add the subject if it is not there.")
    ] = False,
    id: Annotated[
        str | None,
        typer.Option(
            "--id",
            help="The model's id where it was exported, or its first digits: a file that was changed "
            "since is refused. Else as the file's name ends.",
        ),
    ] = None,
    form: VendorFormat = None,
    layout: Annotated[
        str | None, typer.Option("--layout", "-l", help="Of the glove; with --format only.")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Take over a model that another service exported, or with --format another program's calibration.

    It is tried first, and not activated.
    """
    if (form is None) != (layout is None) or (form is not None and subject is None):
        raise typer.BadParameter("--format, --layout and --subject go together: whose, of which glove")
    with connect() as service:
        if form is not None and layout is not None and subject is not None:
            found = imported_calibration(service, file, form, layout, subject, create_subject=create_subject)
        else:
            found = service.import_model(file, subject=subject, create_subject=create_subject, id=id)
    imported = read_or_print(ImportedModel, found, as_json)
    kept = imported.model
    if not imported.is_new:
        out.print(f"Model {kept.short} of {kept.subject} was here already.")
        return
    out.print(f"Model {kept.short} of {kept.subject}, layout {kept.layout}, was imported. To predict live:")
    out.print(f"  glovecal model activate {kept.short}")


def active_model(service: RestClient, subject: str | None, layout: str | None) -> str:
    """Its id. Raises BadParameter without a subject, Refusal when there is none, or one of each layout or
    hand."""
    if subject is None:
        raise typer.BadParameter("name a model, or a subject with --subject")
    active = [row for row in stored_models(service, subject=subject, layout=layout) if row.active]
    layouts = sorted({row.layout for row in active})
    if len(layouts) > 1:
        raise Refusal(
            f"subject {subject} has active models of {', '.join(layouts)}; choose one with --layout"
        )
    if len(active) > 1:
        each = " and ".join(f"{row.short} of the {row.hand} hand" for row in active)
        raise Refusal(
            f"subject {subject} has two gloves and two active models: {each}; name the one you mean"
        )
    if not active:
        raise Refusal(f"subject {subject} has no active model; train one: glovecal train --subject {subject}")
    return active[0].id


# A model's effects and the kernels that were tried, as rows of tables.


MOST_NUMBERS = 8
"""A donning shift has two for each wearing; the rest is counted, and in --json."""
EFFECT_COLUMNS = {
    "effect": "effect",
    "rotation": "rotation",
    "numbers": "learned",
    "evidence": "when it was added",
}
KERNEL_COLUMNS = {
    "rotation": "rotation",
    "kernel": "kernel",
    "chosen": "chosen",
    "held_out_rmse_deg": "error (°)",
    "nlml": "NLML (nats)",
    "evidence_gain": "evidence (nats)",
}
LINE_COLUMNS = {
    "rotation": "rotation",
    "sensor": "sensor",
    "scale": "scale (°/count)",
    "offset": "offset (°)",
}


def effect_rows(effects: Sequence[ModelEffect]) -> list[dict[str, Any]]:
    return [
        {
            "effect": effect.effect if first else "",
            "rotation": rotation,
            "numbers": _numbers(effect.parameters.get(rotation, {})),
            "evidence": effect.evidence if first else "",
        }
        for effect in effects
        for first, rotation in _marked(effect.rotations)
    ]


def _marked(rotations: Sequence[str]) -> list[tuple[bool, str]]:
    """Whether it is the first; an effect on no rotation still has a row."""
    return [(place == 0, name) for place, name in enumerate(rotations or [""])]


def _numbers(values: Mapping[str, float | None]) -> str:
    shown = [
        f"{name} {'?' if value is None else format(value, '.3g')}"
        for name, value in list(values.items())[:MOST_NUMBERS]
    ]
    more = len(values) - len(shown)
    return ", ".join(shown) + (f" and {more} more" if more > 0 else "")


def kernel_rows(rotations: Sequence[Rotation]) -> list[dict[str, Any]]:
    """One row a candidate, after what their errors are to be read against."""
    rows: list[dict[str, Any]] = []
    for rotation in rotations:
        found, name = rotation.kernel_choice, {"rotation": rotation.rotation}
        if found is None:
            continue
        scale = {"mean angle": found.spread_deg, "straight line": found.straight_line_deg}
        rows += [{**name, "kernel": words, "held_out_rmse_deg": error} for words, error in scale.items()]
        rows += [{**vars(item), **name, "chosen": item.chosen or None} for item in found.candidates]
    return rows


def line_rows(rotations: Sequence[Rotation]) -> list[dict[str, Any]]:
    """One row for each reading of a linear rotation, the offset in its first."""
    return [
        {
            "rotation": "" if place else rotation.rotation,
            "sensor": sensor,
            "scale": f"{scale:.4g}",
            "offset": "" if place else f"{rotation.line.offset_deg:.1f}",
        }
        for rotation in rotations
        if rotation.line
        for place, (sensor, scale) in enumerate(rotation.line.scale_deg.items())
    ]
