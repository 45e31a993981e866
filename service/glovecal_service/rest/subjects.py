"""``subjects``: the people whose hands are calibrated."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated

from fastapi import APIRouter, Response
from pydantic import BaseModel, Field

from glovecal_service.rest.answers import change_problems, problems
from glovecal_service.rest.dependencies import StoreNeeded
from glovecal_service.rest.names import Channel, Identifier, Millimetres, NameInPath, Title
from glovecal_service.rest.strict_body import StrictBody
from glovecal_service.store.records import SubjectRecord

router = APIRouter(prefix="/subjects", tags=["subjects"])


class NewSubject(StrictBody):
    name: Identifier
    title: Title = ""
    dimensions: Annotated[dict[Channel, Millimetres], Field(max_length=100)] = Field(default_factory=dict)


class Subject(BaseModel):
    name: str
    title: str
    dimensions: dict[str, float] = Field(description="Hand dimensions in millimetres.")
    created_at: datetime


@router.post(
    "",
    status_code=201,
    response_model=Subject,
    summary="Add a subject",
    responses=change_problems(409),
)
def add_subject(body: NewSubject, store: StoreNeeded, response: Response) -> SubjectRecord:
    """409 when the name is taken."""
    record = store.subjects.create(body.name, title=body.title, dimensions=dict(body.dimensions))
    response.headers["Location"] = f"/v1/subjects/{record.name}"
    return record


@router.get("", response_model=list[Subject], summary="All subjects", responses=problems())
def list_subjects(store: StoreNeeded) -> list[SubjectRecord]:
    return store.subjects.list()


@router.get("/{name}", response_model=Subject, summary="One subject", responses=problems())
def get_subject(name: NameInPath, store: StoreNeeded) -> SubjectRecord:
    return store.subjects.get(name)


@router.delete(
    "/{name}",
    status_code=204,
    response_class=Response,
    summary="Remove a subject",
    responses=change_problems(409),
)
def remove_subject(name: NameInPath, store: StoreNeeded) -> None:
    """409 while the subject owns takes or models."""
    store.subjects.remove(name)
