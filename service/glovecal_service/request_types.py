"""What a request may hold, as types: names, ids and JSON bodies; nothing else reaches the store."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    FiniteFloat,
    StringConstraints,
    model_validator,
)

from glovecal_models.errors import BadInput
from glovecal_models.names import did_you_mean
from glovecal_models.presentation.field_descriptions import describe_fields

ID = r"^[0-9a-f]{12}$"
IDENTIFIER = r"^[a-z0-9][a-z0-9_-]{0,63}$"
SUBJECT = r"^[A-Za-z0-9][A-Za-z0-9_-]{0,63}$"
CHANNEL = r"^[A-Za-z][A-Za-z0-9_]{0,63}$"
ONE_LINE = r"^[^\x00-\x1f\x7f-\x9f\u2028\u2029]*$"
SHA256 = r"^[0-9a-f]{64}$"
SHA256_PREFIX = r"^[0-9a-f]{6,64}$"

LONGEST_SHOWN = 64
"""Of a value that somebody gave in the place of a name."""

MEANING = {
    IDENTIFIER: "use a-z, 0-9, _ and -, at most 64, not starting with _ or -",
    SUBJECT: "use a-z, 0-9, _ and -, at most 64, not starting with _ or -",
    CHANNEL: "use a letter, then letters, digits and _, at most 64",
    SHA256: "give 64 digits of 0-9 and a-f",
    SHA256_PREFIX: "give 6 to 64 digits of 0-9 and a-f",
    ONE_LINE: "give one line of text without control characters",
    ID: "give the 12 digits of 0-9 and a-f that it got when it was made",
}
"""What would be right, for each pattern."""

Identifier = Annotated[str, StringConstraints(pattern=IDENTIFIER)]
"""Gloves, layouts, wearings, recordings: as in ``glovecal_models.names``."""
SubjectName = Annotated[str, StringConstraints(pattern=SUBJECT), AfterValidator(str.lower)]
"""A subject's name, stored in lower case: ``Anna`` is ``anna``."""
Channel = Annotated[str, StringConstraints(pattern=CHANNEL)]
TakeReference = Annotated[str, StringConstraints(min_length=1, max_length=200, pattern=ONE_LINE)]
"""A take's id, or its name."""
ModelReference = Annotated[str, StringConstraints(pattern=SHA256_PREFIX)]
"""A model's id (sha256 of its artifact) or a prefix of at least 6 digits."""
Sha256 = Annotated[str, StringConstraints(pattern=SHA256)]
WearingName = Annotated[str, StringConstraints(min_length=1, max_length=200, pattern=ONE_LINE)]
EffectName = Annotated[str, StringConstraints(min_length=1, max_length=64, pattern=ONE_LINE)]
Seed = Annotated[int, Field(ge=0, le=2**31 - 1)]
Title = Annotated[str, StringConstraints(max_length=200, pattern=ONE_LINE)]
"""Free text for people: one line, no control characters."""
Id = Annotated[str, StringConstraints(pattern=ID)]
"""Of takes, recordings and jobs."""
Millimetres = Annotated[FiniteFloat, Field(gt=0, lt=1000)]


class StrictBody(BaseModel):
    """Takes exactly the documented fields and types: nothing is coerced, nothing is ignored."""

    model_config = ConfigDict(strict=True, extra="forbid", json_schema_extra=describe_fields)

    @model_validator(mode="before")
    @classmethod
    def _names_its_fields(cls, values: Any) -> Any:
        known = [item.alias or name for name, item in cls.model_fields.items()]
        unknown = [key for key in values if key not in known] if isinstance(values, dict) else []
        if unknown:
            key = str(unknown[0])[:LONGEST_SHOWN]
            raise BadInput(f"unknown key {key!r}; {did_you_mean(key, known)}")
        return values
