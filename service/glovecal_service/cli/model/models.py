"""``glovecal model``: a subject's calibration models, and the one that predicts live."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from glovecal_service.cli.model.vendor_files import (
    VendorFormat,
    exported_calibration,
    imported_calibration,
    print_left_out,
)
from glovecal_service.cli.terminal.connection import connect
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
    err,
    moment,
    out,
    print_facts,
    print_json,
    print_sentences,
    print_table,
)
from glovecal_service.cli.terminal.refusal import Refusal
from glovecal_service.cli.terminal.writing import Overwrite, require_place, write_whole

if TYPE_CHECKING:
    from glovecal_client.rest import RestClient

WhoseModel = typer.Option(
    "--subject", "-s", help="Whose model it is; else whom it names.", callback=subject_named
)

app = typer.Typer(help="Calibration models: versions, activation, export, import.", no_args_is_help=True)


@app.command("list")
def list_models(subject: OnlySubject = None, layout: OnlyLayout = None, as_json: AsJson = False) -> None:
    """List models, oldest first; the active one of each subject, layout and hand is marked."""
    wanted = {"subject": subject, "layout": layout}
    with connect() as service:
        rows = service.get("/models", {key: value for key, value in wanted.items() if value})
    if as_json:
        print_json(rows)
        return
    shown = [
        {
            **row,
            "short": row["id"][:12],
            "method": _method(row),
            "errors": _errors(row),
            "created_at": moment(row["created_at"]),
        }
        for row in rows
    ]
    columns = {
        "short": "model",
        "subject": "subject",
        "layout": "layout",
        **({"hand": "hand"} if any(row["hand"] for row in rows) else {}),
        "method": "method",
        "errors": "error (°)",
        "active": "active",
        "created_at": "trained",
    }
    print_table(shown, columns, empty="No models yet. Train one: glovecal train --subject NAME")
    if any(row["rmse_unseen_wearing_deg"] is not None for row in rows):
        out.print("Errors: in a wearing not seen / in wearings seen.")
    for row in rows:
        if row["damage"]:
            err.print(f"Damaged and active: {row['damage']}", style="red")


@app.command("show")
def show(model: Model, as_json: AsJson = False) -> None:
    """Show one model: errors of each rotation, effects, takes, lineage."""
    with connect() as service:
        document = service.get(f"/models/{model}")
        lineage = service.get(f"/models/{document['id']}/lineage")
    if as_json:
        print_json({**document, "lineage": [row["id"] for row in lineage]})
        return
    print_facts(_facts(document, lineage))
    print_sentences((document["unseen_wearing"] or {}).get("sentences", ()))
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
    print_table(document["rotations"], columns, empty="No rotations.")
    lines = line_rows(document["rotations"])
    if lines:
        out.print()
        out.print("Lines: angle = scale x reading + ... + offset")
        print_table(lines, LINE_COLUMNS, empty="")
    tried = kernel_rows(document["rotations"])
    if tried:
        out.print()
        out.print("Kernels tried: errors on takes left out, evidence over the first")
        print_table(tried, KERNEL_COLUMNS, empty="")
        for row in document["rotations"]:
            if row["kernel_choice"]:
                err.print(row["kernel_choice"]["sentence"])
    if document["effect_details"]:
        out.print()
        print_table(effect_rows(document["effect_details"]), EFFECT_COLUMNS, empty="")


def _errors(row: dict[str, Any]) -> str | float | None:
    """In a wearing not seen, then in those seen, where both are known."""
    unseen, seen = row["rmse_unseen_wearing_deg"], row["held_out_rmse_deg"]
    return seen if unseen is None or seen is None else f"{unseen:.2f} / {seen:.2f}"


def _method(row: dict[str, Any]) -> str:
    """The regressors and the effects on top of them."""
    effects = ", ".join(dict.fromkeys(row["effects"]))
    return f"{row['method']} + {effects}" if effects else row["method"]


def _facts(document: dict[str, Any], lineage: list[dict[str, Any]]) -> dict[str, Any]:
    return {
        "model": document["id"],
        "subject": document["subject"],
        "layout": document["layout"],
        "hand": document["hand"],
        "method": document["method"],
        "active": document["active"],
        "error (°)": document["held_out_rmse_deg"],
        "estimated on": document["error_estimate"].get("how"),
        "trained on": [take["name"] for take in document["facts"].get("takes", [])],
        "simulated": document["simulated"],
        "trained": moment(document["created_at"]),
        "made from": [row["id"][:12] for row in lineage[1:]],
    }


@app.command("activate")
def activate(model: Model) -> None:
    """Predict live with this model from the next frame on."""
    with connect() as service:
        document = service.post(f"/models/{model}/activate")
    out.print(f"Model {document['model'][:12]} is active for {document['subject']}, {document['layout']}.")


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
        child = service.post(f"/models/{model}/refine", body)
    out.print(f"Model {child['id'][:12]} of {child['subject']}: {child['facts']['sentences'][0]}")
    if not activate:
        out.print(f"  glovecal model activate {child['id'][:12]}")


@app.command("rollback")
def rollback(subject: Subject, layout: OnlyLayout = None, hand: OnlyHand = None) -> None:
    """Return to the model that was active before. Layout and hand are needed only if there are several."""
    with connect() as service:
        wanted = {"subject": subject, "layout": layout or _only_layout(service, subject), "hand": hand}
        document = service.post("/models/rollback", wanted)
    out.print(f"Model {document['model'][:12]} is active again for {subject}, {wanted['layout']}.")


def _only_layout(service: RestClient, subject: str) -> str:
    service.get(f"/subjects/{subject}")
    layouts = sorted({row["layout"] for row in service.get("/models", {"subject": subject})})
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
            text, left_out = exported_calibration(service, model, form)
        write_whole({file: text.encode()})
        print_left_out(left_out)
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
            found, left_out = imported_calibration(
                service, file, form, layout, subject, create_subject=create_subject
            )
            print_left_out(left_out)
        else:
            found = service.import_model(file, subject=subject, create_subject=create_subject, id=id)
    if as_json:
        print_json(found)
        return
    model, short = found["model"], found["model"]["id"][:12]
    if not found["is_new"]:
        out.print(f"Model {short} of {model['subject']} was here already.")
        return
    out.print(
        f"Model {short} of {model['subject']}, layout {model['layout']}, was imported. To predict live:"
    )
    out.print(f"  glovecal model activate {short}")


def active_model(service: RestClient, subject: str | None, layout: str | None) -> str:
    """Its id. Raises BadParameter without a subject, Refusal when there is none, or one of each layout or
    hand."""
    if subject is None:
        raise typer.BadParameter("name a model, or a subject with --subject")
    query = {"subject": subject} | ({"layout": layout} if layout else {})
    active = [row for row in service.get("/models", query) if row["active"]]
    layouts = sorted({row["layout"] for row in active})
    if len(layouts) > 1:
        raise Refusal(
            f"subject {subject} has active models of {', '.join(layouts)}; choose one with --layout"
        )
    if len(active) > 1:
        each = " and ".join(f"{row['id'][:12]} of the {row['hand']} hand" for row in active)
        raise Refusal(
            f"subject {subject} has two gloves and two active models: {each}; name the one you mean"
        )
    if not active:
        raise Refusal(f"subject {subject} has no active model; train one: glovecal train --subject {subject}")
    return active[0]["id"]


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
SCALE = (("mean angle", "spread_deg"), ("straight line", "straight_line_deg"))
"""What the candidates' errors are to be read against."""


def effect_rows(effects: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """From the ``effect_details`` of a model document."""
    return [
        {
            "effect": effect["effect"] if first else "",
            "rotation": rotation,
            "numbers": _numbers(effect["parameters"].get(rotation, {})),
            "evidence": effect["evidence"] if first else "",
        }
        for effect in effects
        for first, rotation in _marked(effect["rotations"])
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


def kernel_rows(rotations: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """One row a candidate, after those of the scale."""
    rows: list[dict[str, Any]] = []
    for rotation in rotations:
        found, name = rotation["kernel_choice"], {"rotation": rotation["rotation"]}
        if found is None:
            continue
        rows += [{**name, "kernel": words, "held_out_rmse_deg": found[error]} for words, error in SCALE]
        rows += [{**item, **name, "chosen": item["chosen"] or None} for item in found["candidates"]]
    return rows


def line_rows(rotations: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """One row for each reading of a linear rotation, the offset in its first."""
    return [
        {
            "rotation": "" if place else rotation["rotation"],
            "sensor": sensor,
            "scale": f"{scale:.4g}",
            "offset": "" if place else f"{rotation['line']['offset_deg']:.1f}",
        }
        for rotation in rotations
        if rotation["line"]
        for place, (sensor, scale) in enumerate(rotation["line"]["scale_deg"].items())
    ]
