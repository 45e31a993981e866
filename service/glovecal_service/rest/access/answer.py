"""Keys, people and the log of changes as REST gives them."""

from __future__ import annotations

from datetime import datetime
from typing import Any

from pydantic import Field

from glovecal_client.site.roles import Role
from glovecal_service.plain import Row


class Key(Row):
    name: str
    role: Role
    subjects: list[str] | None = Field(description="Whose takes and models it sees; null: everybody's.")
    created_at: datetime
    revoked_at: datetime | None

    @property
    def sees(self) -> str:
        """Whose, in words."""
        return "everybody" if self.subjects is None else ", ".join(self.subjects)


class NewKey(Key):
    key: str = Field(description="The key itself; nobody can be told it again.")


class Person(Key):
    password_changed_at: datetime | None = Field(description="Null: the password is kept elsewhere.")
    issuer: str | None = Field(
        description="The provider of OpenID Connect that says who this is and gives the role; null: they "
        "log in with a password."
    )


class AuditRow(Row):
    id: int
    at: datetime
    who: str = Field(description="The name of a key or a person, or `this computer`.")
    origin: str = Field(description="The address that the request came from.")
    action: str = Field(description="What was asked, such as `POST /v1/models/train`.")
    changes: list[dict[str, Any]] = Field(description="Rows: table, key, values before and after.")
    sha256: str = Field(description="Of this entry and the one before it.")


class AuditCheck(Row):
    entries: int
    problems: list[str] = Field(description="What does not fit; none: the log is what was written.")
