"""``live-gloves``: what the real-time process says of each glove now."""

from __future__ import annotations

from contextlib import suppress
from typing import Any

import zenoh
from fastapi import APIRouter
from pydantic import ValidationError

from glovecal_client.errors import BadName, NoAnswer
from glovecal_client.keys import GloveKeys, all_gloves, parse_glove_key
from glovecal_client.session import ask, json_object, open_client
from glovecal_service.realtime.service_status import all_service_statuses
from glovecal_service.rest.glove.answer import LiveGlove
from glovecal_service.rest.http.dependencies import PartsNeeded
from glovecal_service.rest.http.list_part import InParts
from glovecal_service.rest.http.problem import change_problems
from glovecal_service.store.errors import Conflict

router = APIRouter(prefix="/live-gloves", tags=["gloves"])

WITHIN_S = 1.0
WARM_UP_S = 1200.0
"""Of a CyberGlove III (Krnoul et al. 2016, section 4): no figure is known of others. Capture tells since when
it hears the glove, not since when that is on."""


@router.get("", response_model=list[LiveGlove], summary="Gloves now", responses=change_problems(409))
def live_gloves(parts: PartsNeeded, paging: InParts) -> list[LiveGlove]:
    """Each glove whose frames arrive: how it is served, and warnings. 409 where real time does not answer."""
    try:
        with open_client((parts.settings.zenoh,), wait_s=WITHIN_S) as session:
            answers = ask(session, all_service_statuses(parts.settings.site), timeout_s=WITHIN_S)
            on_for = _on_for_s(session, parts.settings.site)
    except NoAnswer as error:
        raise Conflict(f"real time does not answer: {error}; is glovecal serve running?") from error
    found: dict[str, LiveGlove] = {}
    for answer in answers:
        gloves = (json_object(answer.payload.to_bytes()) or {}).get("gloves")
        for glove, one in gloves.items() if isinstance(gloves, dict) else ():
            run_id = str(one.get("run_id")) if isinstance(one, dict) else ""
            view = _as_said(glove, one, on_for.get((glove, run_id)))
            if view is not None and parts.store.actor.sees(view.subject):
                found.setdefault(glove, view)
    return paging.part_of(found.values(), lambda view: view.glove)


def _as_said(glove: str, said: Any, on_for_s: float | None) -> LiveGlove | None:
    """None for what real time does not say: anyone in the network may answer in its name."""
    if not isinstance(said, dict):
        return None
    names = ("state", "subject", "wearing", "layout", "model", "sentence")
    try:
        return LiveGlove(
            glove=glove,
            warnings=said.get("warnings", []),
            on_for_s=on_for_s,
            warm_up_left_s=None if on_for_s is None else max(0.0, WARM_UP_S - on_for_s),
            **{name: said.get(name) for name in names},
        )
    except ValidationError:
        return None


def _on_for_s(session: zenoh.Session, site: str) -> dict[tuple[str, str], float]:
    """By glove and run: for how many seconds it is captured, by the clock of its computer. Only that of the
    run whose frames come is the glove's."""
    found: dict[tuple[str, str], float] = {}
    with suppress(NoAnswer):
        for sample in ask(session, all_gloves(site, "status"), timeout_s=WITHIN_S):
            status = json_object(sample.payload.to_bytes()) or {}
            began, now = status.get("started_wall_ns"), status.get("wall_ns")
            with suppress(BadName, OverflowError):  # a stranger's key, or times of hundreds of digits
                glove = parse_glove_key(str(sample.key_expr))[0].glove
                if isinstance(began, int) and isinstance(now, int):
                    found[glove, str(status.get("run_id"))] = max(0.0, (now - began) / 1e9)
    return found


def has_publisher(endpoint: str, keys: GloveKeys) -> bool:
    """Whether a capture daemon or a camera has the glove now; none has where no router answers."""
    try:
        with open_client((endpoint,), wait_s=WITHIN_S) as session:
            tokens = session.liveliness().get(keys.alive, timeout=WITHIN_S)
            return any(reply.ok is not None for reply in tokens)
    except NoAnswer:
        return False
