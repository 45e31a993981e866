"""``keys``: with which programs and people prove who they are."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter
from pydantic import Field

from glovecal_client.site.roles import Role
from glovecal_service.request_types import StrictBody, SubjectName
from glovecal_service.rest.access.answer import Key, NewKey
from glovecal_service.rest.http.dependencies import StoreNeeded
from glovecal_service.rest.http.list_part import Searched
from glovecal_service.rest.http.problem import change_problems, problems

router = APIRouter(prefix="/keys", tags=["access"])
MOST_SUBJECTS = 1000


class Scope(StrictBody):
    role: Role
    subjects: Annotated[list[SubjectName], Field(min_length=1, max_length=MOST_SUBJECTS)] | None = Field(
        None, description="Whose takes and models may be seen and changed; null: everybody's."
    )


class KeyBody(Scope):
    name: SubjectName = Field(description="Who or what has it. Never used again.")


@router.get("", summary="Keys", responses=problems())
def list_keys(store: StoreNeeded, paging: Searched) -> list[Key]:
    """By name, those that were revoked among them."""
    return [
        Key.model_validate(record, from_attributes=True)
        for record in paging.answer(store.keys.page(paging.part))
    ]


@router.post("", status_code=201, summary="Make a key", responses=change_problems(409))
def add_key(body: KeyBody, store: StoreNeeded) -> NewKey:
    """The answer is the only place where it stands."""
    record, secret = store.keys.create(body.name, body.role, body.subjects)
    return NewKey(**vars(Key.model_validate(record, from_attributes=True)), key=secret)


@router.delete("/{name}", summary="Revoke a key", responses=change_problems())
def revoke_key(name: str, store: StoreNeeded) -> Key:
    """From the next request on it opens nothing; sessions of the studio that began with it end."""
    return Key.model_validate(store.keys.revoke(name), from_attributes=True)
