"""``live-gloves``: what the real-time process says of each glove now."""

from __future__ import annotations

from contextlib import suppress
from typing import Any, Literal

import zenoh
from fastapi import APIRouter
from pydantic import BaseModel, Field

from glovecal_client.errors import NoAnswer
from glovecal_client.keys import all_gloves, parse_glove_key
from glovecal_client.queries import ask, ask_json, json_object
from glovecal_client.session import open_client
from glovecal_service.realtime.service_status import all_service_statuses
from glovecal_service.rest.http.answers import change_problems
from glovecal_service.rest.http.dependencies import PartsNeeded
from glovecal_service.store.errors import Conflict
from glovecal_service.views.warm_up import warm_up_left_s

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
    on_for_s: float | None = Field(description="Since capture began; null where it does not answer.")
    warm_up_left_s: float | None = Field(description="Of 20 minutes; 0 for a warm glove.")


@router.get("", response_model=list[LiveGlove], summary="Gloves now", responses=change_problems(409))
def live_gloves(parts: PartsNeeded) -> list[dict[str, Any]]:
    """Each glove whose frames arrive: how it is served, and warnings. 409 where real time does not answer."""
    try:
        with open_client((parts.settings.zenoh,), wait_s=WITHIN_S) as session:
            said = ask_json(session, all_service_statuses(parts.settings.site), timeout_s=WITHIN_S)
            on_for = _on_for_s(session, parts.settings.site)
    except NoAnswer as error:
        raise Conflict(f"real time does not answer: {error}; is glovecal serve running?") from error
    names = ("state", "subject", "wearing", "layout", "model", "sentence")
    return [
        {
            "glove": glove,
            "warnings": one.get("warnings", []),
            "on_for_s": on_for.get(glove),
            "warm_up_left_s": warm_up_left_s(on_for[glove]) if glove in on_for else None,
            **{name: one.get(name) for name in names},
        }
        for glove, one in said.get("gloves", {}).items()
    ]


def _on_for_s(session: zenoh.Session, site: str) -> dict[str, float]:
    """How long each glove is captured, by the clock of its computer. A restart of capture begins anew."""
    found: dict[str, float] = {}
    with suppress(NoAnswer):
        for sample in ask(session, all_gloves(site, "status"), timeout_s=WITHIN_S):
            status = json_object(sample.payload.to_bytes()) or {}
            began, now = status.get("started_wall_ns"), status.get("wall_ns")
            if isinstance(began, int) and isinstance(now, int):
                found[parse_glove_key(str(sample.key_expr))[0].glove] = max(0.0, (now - began) / 1e9)
    return found
