"""What an address or a query may hold, as types."""

from __future__ import annotations

from typing import Annotated

from fastapi import Path, Query
from pydantic import AfterValidator

from glovecal_models.hand.rotations import Handedness
from glovecal_service.request_types import ID, IDENTIFIER, ONE_LINE, SHA256_PREFIX, SUBJECT, SubjectName

NameInPath = Annotated[str, Path(pattern=IDENTIFIER, description="a-z, 0-9, _ and -, at most 64.")]
ModelInPath = Annotated[
    str, Path(pattern=SHA256_PREFIX, description="A model's id, or at least its first 6 digits.")
]
IdInPath = Annotated[str, Path(pattern=ID, description="As given when it was made.")]
SubjectInPath = Annotated[
    str,
    Path(pattern=SUBJECT, description="a-z, 0-9, _ and -, at most 64; capitals are read as lower case."),
    AfterValidator(str.lower),
]
EffectInPath = Annotated[str, Path(max_length=64, pattern=ONE_LINE, description="As in the catalogue.")]
SubjectFilter = Annotated[SubjectName | None, Query(description="Only this subject's.")]
HandFilter = Annotated[
    Handedness | None, Query(description="Only this hand's, and those of which nobody said whose they are.")
]
LayoutFilter = Annotated[str | None, Query(pattern=IDENTIFIER, description="Only of this layout.")]
