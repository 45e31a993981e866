"""Calibrations of other programs in ``model import`` and ``model export``: converted, then like any model."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from glovecal_service.cli.terminal.printing import err
from glovecal_service.cli.terminal.refusal import Refusal

if TYPE_CHECKING:
    from glovecal_client.rest import RestClient

FormatName = Literal["virtualhand", "asr", "shadow_xml", "shadow_yaml", "opengloves"]
VendorFormat = Annotated[
    FormatName | None,
    typer.Option("--format", help="Of another program: VirtualHand and DCU, ASR, Shadow, OpenGloves."),
]


def imported_calibration(
    service: RestClient, file: Path, form: FormatName, layout: str, subject: str, *, create_subject: bool
) -> tuple[dict[str, Any], Mapping[str, str]]:
    """What ``import_model`` answers, and why sensors of the file were left out. Raises Refusal."""
    from glovecal_models.calibration.artifact import dump  # a second to load, which other verbs need not wait
    from glovecal_models.errors import BadInput
    from glovecal_models.layout import Layout
    from glovecal_service.vendor_calibrations.formats import calibration_format
    from glovecal_service.vendor_calibrations.line_model import read_model

    people = {row["name"]: row for row in service.get("/subjects")}
    hand = people.get(subject, {"hand": "right"})["hand"]
    document = service.get(f"/gloves/{layout}")["document"]
    try:
        text = file.read_text(encoding="utf-8")
        form_of_file = calibration_format(form)
        model, found = read_model(text, form_of_file, Layout.from_document(document), subject, hand)
    except (BadInput, UnicodeDecodeError) as error:
        raise Refusal(f"{file}: {error}") from error
    with tempfile.TemporaryDirectory(prefix="glovecal-import-") as folder:
        artifact = Path(folder, "model.safetensors")
        artifact.write_bytes(dump(model))
        answer = service.import_model(artifact, subject=subject, create_subject=create_subject)
    return answer, found.left_out


def exported_calibration(service: RestClient, model: str, form: FormatName) -> tuple[str, Mapping[str, str]]:
    """The file's text, and why rotations were left out. Raises Refusal."""
    from glovecal_models.calibration.artifact import load
    from glovecal_models.errors import BadInput
    from glovecal_service.vendor_calibrations.formats import calibration_format
    from glovecal_service.vendor_calibrations.line_model import write_model

    row = service.get(f"/models/{model}")
    hand = service.get(f"/subjects/{row['subject']}")["hand"]
    try:
        written = write_model(
            load(service.download(f"/models/{model}/export")), calibration_format(form), hand
        )
    except BadInput as error:
        raise Refusal(str(error)) from error
    return written.text, written.left_out


def print_left_out(left_out: Mapping[str, str]) -> None:
    if left_out:
        err.print("Left out: " + "; ".join(f"{name}: {why}" for name, why in left_out.items()) + ".")
