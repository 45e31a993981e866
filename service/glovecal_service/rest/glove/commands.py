"""``glove-commands``: what gloves can be asked beside their streams: battery, clock, recordings on a card."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from itertools import combinations
from math import hypot
from typing import Annotated

import zenoh
from fastapi import APIRouter
from pydantic import Field

from glovecal_client.errors import NoAnswer, QueryRefused
from glovecal_client.keys import GloveKeys
from glovecal_client.session import ask_json, open_client
from glovecal_service.request_types import Identifier, StrictBody
from glovecal_service.rest.glove.answer import GloveAnswer, GloveAnswers
from glovecal_service.rest.http.dependencies import Parts, PartsNeeded
from glovecal_service.rest.http.problem import change_problems
from glovecal_service.store.errors import Conflict


def clock_sentences(answers: Sequence[GloveAnswer]) -> list[str]:
    """How far each two gloves' clocks are apart, with the standard deviation, and which cannot be trusted."""
    known = {item.glove: item.card.clock for item in answers if item.card.clock is not None}
    told = [
        f"The clock of {name} counts no frames, or jumps: only its whole seconds were used."
        for name, clock in known.items()
        if not clock.is_consistent
    ]
    for (one, first), (other, second) in combinations(known.items(), 2):
        apart = first.ahead_s - second.ahead_s
        sd = hypot(first.sd_s, second.sd_s)
        told.append(
            f"The clock of {one} is {1e3 * apart:+.1f} ms ahead of that of {other}, standard deviation "
            f"{1e3 * sd:.1f} ms."
        )
    return told


router = APIRouter(prefix="/glove-commands", tags=["gloves"])

MOST_GLOVES = 8
ROUTER_WITHIN_S = 1.0
ANSWER_WITHIN_S = 20.0
"""Setting a clock takes some seconds."""


class GloveCommand(StrictBody):
    gloves: Annotated[list[Identifier], Field(min_length=1, max_length=MOST_GLOVES)]
    do: Annotated[str, Field(pattern=r"^[a-z][a-z-]{0,31}$")] = Field(
        "status", description="As the glove's meta lists under `commands`."
    )
    argument: Annotated[str, Field(max_length=64, pattern=r"^[A-Za-z0-9._-]*$")] = Field(
        "", description="What the command needs, such as a file's name."
    )


@router.post("", response_model=GloveAnswers, summary="Command gloves", responses=change_problems(409))
def command_gloves(body: GloveCommand, parts: PartsNeeded) -> GloveAnswers:
    """All gloves are asked at the same moment; each answers for itself. 404 for a glove that was never seen,
    409 where no zenoh router answers. A glove's stream pauses while it carries out a command."""
    wanted = list(dict.fromkeys(body.gloves))
    for name in wanted:
        parts.store.gloves.get(name)
    try:
        with (
            open_client((parts.settings.zenoh,), wait_s=ROUTER_WITHIN_S) as session,
            ThreadPoolExecutor(len(wanted)) as at_once,
        ):
            answers = list(at_once.map(lambda name: _ask(session, parts, name, body), wanted))
    except NoAnswer as error:
        raise Conflict(f"gloves cannot be reached: {error}") from error
    return GloveAnswers(answers=answers, sentences=clock_sentences(answers))


def _ask(session: zenoh.Session, parts: Parts, glove: str, body: GloveCommand) -> GloveAnswer:
    key = GloveKeys(parts.settings.site, glove).control
    try:
        selector = f"{key}?do={body.do};with={body.argument}"
        answer = ask_json(session, selector, timeout_s=ANSWER_WITHIN_S)
        return GloveAnswer(glove=glove, answer=answer, problem=None)
    except QueryRefused as refused:
        problem = str(refused).partition(": ")[2]
    except NoAnswer:
        start = f"glovecal capture --device DEVICE --glove {glove}"
        problem = f"no capture of glove {glove} answers; start it: {start}"
    return GloveAnswer(glove=glove, answer=None, problem=problem)
