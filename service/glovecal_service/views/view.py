"""The base of all views."""

from __future__ import annotations

from typing import Any

from pydantic import BaseModel, model_validator

from glovecal_service.plain import plain
from glovecal_service.views.renamed_keys import with_current_keys


class View(BaseModel):
    """Made of a result by its ``of``; read back from what was stored, old keys included."""

    @model_validator(mode="before")
    @classmethod
    def _renamed(cls, document: Any) -> Any:
        return with_current_keys(document, cls.model_fields)

    def document(self) -> dict[str, Any]:
        """JSON-able; NaN and infinity are null."""
        return plain(self.model_dump(mode="json"))
