"""What a user says about his widgets and poses."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import typer

from glovecal_models.errors import BadInput
from glovecal_service.cli.terminal.options import JOB_ID


def sampling_id(value: str) -> str:
    """A typer callback."""
    if not JOB_ID.match(value):
        raise typer.BadParameter(
            f"{value!r} is not a sampling's id: 12 digits of 0-9 and a-f, as glovecal sample list shows them"
        )
    return value


def widget_angles(told: Sequence[str]) -> dict[str, list[float]]:
    """``IM_ABD=0,12,20`` as degrees by rotation; nothing after ``=`` leaves the rotation out."""
    angles = {}
    for text in told:
        rotation, equals, numbers = text.partition("=")
        try:
            angles[rotation] = [float(number) for number in numbers.split(",") if number.strip()]
        except ValueError:
            equals = ""
        if not equals:
            raise typer.BadParameter(f"--widget {text!r}: write it like IM_ABD=0,12,20")
    return angles


def pose_angles(path: Path | None) -> dict[str, Any]:
    """The content of a JSON file. Raises BadInput, OSError."""
    if path is None:
        return {}
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except ValueError as error:
        raise BadInput(f"{path}: not JSON: {error}") from error
    if not isinstance(document, dict):
        raise BadInput(f'{path}: write it like {{"flat": {{"I_MCP": 2.5}}}}')
    return document
