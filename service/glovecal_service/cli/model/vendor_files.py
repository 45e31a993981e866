"""Calibrations of other programs in ``model import`` and ``model export``: converted, then like any model."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from glovecal_service.cli.terminal.printing import Refusal, err
from glovecal_service.plain import read
from glovecal_service.rest.model.answer import CalibrationFile

if TYPE_CHECKING:
    from glovecal_client.rest import RestClient

FormatName = Literal["virtualhand", "asr", "shadow_xml", "shadow_yaml", "opengloves", "lerobot"]
VendorFormat = Annotated[
    FormatName | None,
    typer.Option("--format", help="Of another program: VirtualHand, DCU, ASR, Shadow, OpenGloves, LeRobot."),
]


def imported_calibration(
    service: RestClient, file: Path, form: FormatName, layout: str, subject: str, *, create_subject: bool
) -> dict[str, Any]:
    """What ``import_model`` answers; it is told what was left out and doubted. Raises Refusal."""
    try:
        text = file.read_text(encoding="utf-8")
    except UnicodeDecodeError as error:
        raise Refusal(f"{file} is not UTF-8 text; save it as UTF-8") from error
    body = {"format": form, "text": text, "layout": layout, "subject": subject}
    answer = service.post("/models/calibrations", body | {"create_subject": create_subject})
    for sensor, doubt in answer.pop("doubts").items():
        err.print(f"{sensor}: {doubt}.", style="yellow")
    print_left_out(answer.pop("left_out"))
    return answer


def exported_calibration(service: RestClient, model: str, form: FormatName) -> CalibrationFile:
    return read(CalibrationFile, service.get(f"/models/{model}/calibration", {"format": form}))


def print_left_out(left_out: Mapping[str, str]) -> None:
    if left_out:
        err.print("Left out: " + "; ".join(f"{name}: {why}" for name, why in left_out.items()) + ".")
