"""Base of every JSON body."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict


class StrictBody(BaseModel):
    """Takes exactly the documented fields and types: nothing is coerced, nothing is ignored."""

    model_config = ConfigDict(strict=True, extra="forbid")
