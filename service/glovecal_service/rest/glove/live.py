"""``live-gloves``: what the real-time process says of each glove now."""

from __future__ import annotations

from typing import Any, Literal

from fastapi import APIRouter
from pydantic import BaseModel, Field

from glovecal_client.errors import NoAnswer
from glovecal_client.queries import ask_json
from glovecal_client.session import open_client
from glovecal_service.realtime.service_status import all_service_statuses
from glovecal_service.rest.http.answers import change_problems
from glovecal_service.rest.http.dependencies import PartsNeeded
from glovecal_service.store.errors import Conflict

router = APIRouter(prefix="/live-gloves", tags=["gloves"])

WITHIN_S = 1.0


class Warning(BaseModel):
    """Something that is wrong, noticed within 10 s of motion."""

    part: str = Field(description='"wearer": wrong person, hand or model; "sensor": dead or stuck.')
    sentence: str
    advice: str


class LiveGlove(BaseModel):
    glove: str
    state: Literal["calibrated", "uncalibrated"] | None
    subject: str | None
    wearing: str | None
    layout: str | None
    model: str | None
    sentence: str | None = Field(description="Why it is not served better, such as by a wrong hand.")
    warnings: list[Warning]


@router.get("", response_model=list[LiveGlove], summary="Gloves now", responses=change_problems(409))
def live_gloves(parts: PartsNeeded) -> list[dict[str, Any]]:
    """Each glove whose frames arrive: how it is served, and warnings. 409 where real time does not answer."""
    try:
        with open_client((parts.settings.zenoh,), wait_s=WITHIN_S) as session:
            said = ask_json(session, all_service_statuses(parts.settings.site), timeout_s=WITHIN_S)
    except NoAnswer as error:
        raise Conflict(f"real time does not answer: {error}; is glovecal serve running?") from error
    names = ("state", "subject", "wearing", "layout", "model", "sentence")
    return [
        {"glove": glove, "warnings": one.get("warnings", []), **{name: one.get(name) for name in names}}
        for glove, one in said.get("gloves", {}).items()
    ]
