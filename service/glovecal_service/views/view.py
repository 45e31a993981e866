"""The base of all views."""

from __future__ import annotations

from typing import Any

from pydantic import BaseModel

from glovecal_service.plain import plain


class View(BaseModel):
    """Made of a result by its ``of``; read back from what was stored."""

    def document(self) -> dict[str, Any]:
        """JSON-able; NaN and infinity are null."""
        return plain(self.model_dump(mode="json"))
