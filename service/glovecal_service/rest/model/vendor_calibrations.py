"""``models/calibrations``: other programs' calibrations as models, and models of lines as such files."""

from __future__ import annotations

from contextlib import suppress
from typing import Annotated, NamedTuple

from fastapi import APIRouter, Query, Response
from pydantic import Field

from glovecal_models.calibration.artifact import dump
from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.errors import BadInput
from glovecal_models.hand.rotations import Handedness
from glovecal_models.layout import Layout
from glovecal_service.exports.vendor_calibrations.calibration_format import FoundLines
from glovecal_service.exports.vendor_calibrations.formats import (
    FORMATS,
    MOST_CHARACTERS,
    FormatName,
    calibration_format,
    calibration_text,
    read_model,
    recognised,
    rotation_line,
    write_model,
)
from glovecal_service.request_types import Identifier, Sha256, StrictBody, SubjectName
from glovecal_service.rest.http.dependencies import Parts, PartsNeeded
from glovecal_service.rest.http.problem import change_problems, problems
from glovecal_service.rest.http.request_types import ModelInPath
from glovecal_service.rest.model.answer import (
    CalibratedRotation,
    CalibrationFile,
    CalibrationPreview,
    ImportedCalibration,
)
from glovecal_service.rest.model.model_import import ModelImport, import_artifact
from glovecal_service.rest.take.uploaded_files import kept_upload
from glovecal_service.store.errors import NotFound

router = APIRouter(prefix="/models", tags=["models"])


class Calibration(StrictBody):
    format: FormatName | None = Field(None, description="None: recognised by what the file holds.")
    text: Annotated[str, Field(min_length=1, max_length=MOST_CHARACTERS)] | None = Field(
        None, description="The file's."
    )
    upload: Sha256 | None = Field(None, description="Or the file, sent to `uploads`.")
    layout: Identifier | None = Field(
        None,
        description="Of the glove that it calibrates. None: the one that it has most rotations of, "
        "and of several one that the subject has takes of.",
    )
    subject: SubjectName
    hand: Handedness | None = Field(None, description="None: the subject's, else right.")


class ImportedAs(Calibration):
    create_subject: bool = Field(False, description="Add the subject if it is not there; else 404.")


@router.post(
    "/calibrations/preview",
    response_model=CalibrationPreview,
    summary="What another program's calibration would become",
    responses=change_problems(),
)
def preview_calibration(body: Calibration, parts: PartsNeeded) -> CalibrationPreview:
    """Nothing is imported. 422 names the line where it cannot be read."""
    reading = _Reading(parts, body)
    best = reading.best()
    return CalibrationPreview(
        format=reading.form.name, title=reading.form.title, subject=body.subject, hand=reading.hand,
        layouts=[each.model.layout.name for each in reading.each()], layout=best.model.layout.name,
        rotations=best.lines(), left_out=dict(best.lines_read.left_out), misses=dict(best.lines_read.doubts),
    )  # fmt: skip


@router.post(
    "/calibrations",
    status_code=201,
    response_model=ImportedCalibration,
    summary="Import another program's calibration",
    responses=change_problems(409)
    | {200: {"model": ImportedCalibration, "description": "This very model was here already."}},
)
def import_calibration(body: ImportedAs, response: Response, parts: PartsNeeded) -> ImportedCalibration:
    """Kept as a model of lines, each with its scale and offset; it is not activated. 422 names the line."""
    if not body.create_subject:
        parts.store.subjects.get(body.subject)
    model, lines = _Reading(parts, body).best()
    options = ModelImport(subject=body.subject, create_subject=body.create_subject, id=None)
    answer = import_artifact(parts, dump(model), options)
    response.status_code = 201 if answer.is_new else 200
    return ImportedCalibration(**dict(answer), left_out=dict(lines.left_out), doubts=dict(lines.doubts))


class _AsModel(NamedTuple):
    model: CalibrationModel
    lines_read: FoundLines

    def lines(self) -> list[CalibratedRotation]:
        """Of the rotations that the file itself tells."""
        return [
            CalibratedRotation(
                rotation=item.rotation, sensor=item.correspondence.sensors[0], gain_deg=line.gain,
                zero=line.zero,
            )
            for item in self.model.rotations
            if (line := rotation_line(item)) is not None
        ]  # fmt: skip


class _Reading:
    """A file that is to be read as a calibration. Raises BadInput for what is none, NotFound."""

    def __init__(self, parts: Parts, body: Calibration) -> None:
        self._parts, self._body = parts, body
        self._text = _text(parts, body)
        form = recognised(self._text) if body.format is None else calibration_format(body.format)
        if form is None:
            known = ", ".join(one.title for one in FORMATS.values())
            raise BadInput(f"this file is no calibration of these formats: {known}; choose another file")
        self.form = form
        self.hand: Handedness = _hand(parts, body)

    def best(self) -> _AsModel:
        """For the layout that is asked for, else for the likeliest one."""
        if self._body.layout is None:
            return self.each()[0]
        return self._read(self._parts.store.layouts.get(self._body.layout))

    def each(self) -> list[_AsModel]:
        """For every layout that it can be of, the likeliest first."""
        fitting: list[_AsModel] = []
        refused = BadInput("there is no layout of a glove; add one with glovecal glove layouts")
        for record in self._parts.store.layouts.list():
            try:
                fitting.append(self._read(Layout.from_document(record.document)))
            except BadInput as error:
                refused = error
        if not fitting:
            raise refused
        own = {take.layout for take in self._parts.store.takes.list(self._body.subject)}

        def fits(each: _AsModel) -> tuple[int, bool, int]:
            layout = each.model.layout
            return -len(each.lines()), layout.name not in own, len(layout.sensors)

        return sorted(fitting, key=fits)

    def _read(self, layout: Layout) -> _AsModel:
        return _AsModel(*read_model(self._text, self.form, layout, self._body.subject, self.hand))


def _text(parts: Parts, body: Calibration) -> str:
    if body.text is not None:
        return body.text
    if body.upload is None:
        raise BadInput("neither upload nor text is given; send the file to uploads and name it, or its text")
    return calibration_text(kept_upload(parts, body.upload))


def _hand(parts: Parts, body: Calibration) -> Handedness:
    if body.hand is not None:
        return body.hand
    with suppress(NotFound):
        return parts.store.subjects.get(body.subject).known_hand or "right"
    return "right"


@router.get(
    "/{id}/calibration",
    response_model=CalibrationFile,
    summary="A model of lines as another program's calibration",
    responses=problems(),
)
def export_calibration(
    id: ModelInPath, parts: PartsNeeded, format: Annotated[FormatName, Query()]
) -> CalibrationFile:
    """422 where no rotation is a line of one sensor, or effects would be lost."""
    record = parts.store.models.get(id)
    model, _ = parts.predictors.get(record.id)
    hand = parts.store.subjects.get(record.subject).known_hand or "right"
    written = write_model(model, calibration_format(format), hand)
    return CalibrationFile(text=written.text, left_out=dict(written.left_out))
