"""``people``: who logs in with a name and a password."""

from __future__ import annotations

from functools import partial
from typing import Annotated

from fastapi import APIRouter
from pydantic import Field, SecretStr

from glovecal_service.request_types import StrictBody
from glovecal_service.rest.access.answer import Person
from glovecal_service.rest.access.keys import KeyBody, Scope
from glovecal_service.rest.http.dependencies import PartsNeeded, StoreNeeded
from glovecal_service.rest.http.list_part import Searched
from glovecal_service.rest.http.problem import change_problems, problems
from glovecal_service.rest.http.request_types import SubjectInPath
from glovecal_service.store.passwords import LEAST_CHARACTERS, MOST_CHARACTERS
from glovecal_service.store.principals import Principal

router = APIRouter(prefix="/people", tags=["access"])
Password = Annotated[
    SecretStr,
    Field(
        description=f"{LEAST_CHARACTERS} to {MOST_CHARACTERS} characters, and not the name. Only its hash "
        "(argon2id) is kept."
    ),
]


class PersonBody(KeyBody):
    password: Password


class PasswordBody(StrictBody):
    password: Password


@router.get("", summary="People who log in", responses=problems())
def list_people(store: StoreNeeded, paging: Searched) -> list[Person]:
    """By name, those that were removed among them."""
    return [_row(record) for record in paging.answer(store.people.page(paging.part))]


@router.post("", status_code=201, summary="Add a person who logs in", responses=change_problems(409))
async def add_person(body: PersonBody, parts: PartsNeeded) -> Person:
    """With a name and a password, on the login page of the studio."""
    password = body.password.get_secret_value()
    create = partial(parts.store.people.create, body.name, body.role, body.subjects, password=password)
    return _row(await parts.guesses.in_turn(create))


@router.put("/{name}", summary="Change what a person may do", responses=change_problems())
def change_person(name: SubjectInPath, body: Scope, store: StoreNeeded) -> Person:
    """Sessions of the person end: who is logged in logs in again."""
    return _row(store.people.change(name, body.role, body.subjects))


@router.put("/{name}/password", summary="Set a person's password", responses=change_problems())
async def set_password(name: SubjectInPath, body: PasswordBody, parts: PartsNeeded) -> Person:
    """Sessions of the person end. People change their own on the login page."""
    change = partial(parts.store.people.set_password, name, body.password.get_secret_value())
    return _row(await parts.guesses.in_turn(change))


@router.delete("/{name}", summary="Remove a person who logs in", responses=change_problems())
def remove_person(name: SubjectInPath, store: StoreNeeded) -> Person:
    """From the next request on nothing is open to them. The name is not used again: the log of changes has
    it."""
    return _row(store.people.revoke(name))


def _row(record: Principal) -> Person:
    return Person.model_validate(record, from_attributes=True)
