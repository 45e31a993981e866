"""Asking one question over zenoh and taking "no answer" for what it is: a failure."""

from __future__ import annotations

import json
from typing import Any

import zenoh

from glovecal_client.errors import NoAnswer, QueryRefused

REFUSAL_ENCODING = "text/plain"
"""Of an answerer's own sentence; zenoh's errors, such as a timeout, come with another one."""


def ask(session: zenoh.Session, selector: str, *, timeout_s: float = 5.0) -> list[zenoh.Sample]:
    """All good replies. Raises QueryRefused with the answerer's own sentence, NoAnswer if nobody answered."""
    samples: list[zenoh.Sample] = []
    problem, refused = "nobody answered", False
    replies = session.get(
        selector,
        timeout=timeout_s,
        target=zenoh.QueryTarget.ALL,
        consolidation=zenoh.ConsolidationMode.NONE,
    )
    for reply in replies:
        if reply.ok is not None:
            samples.append(reply.ok)
        elif reply.err is not None:
            problem = reply.err.payload.to_bytes().decode(errors="replace")[:500]
            refused = str(reply.err.encoding) == REFUSAL_ENCODING
    if not samples:
        raise (QueryRefused if refused else NoAnswer)(f"{selector}: {problem}")
    return samples


def ask_json(session: zenoh.Session, selector: str, *, timeout_s: float = 5.0) -> dict[str, Any]:
    """The first reply that is a JSON object. Raises NoAnswer."""
    for sample in ask(session, selector, timeout_s=timeout_s):
        document = json_object(sample.payload.to_bytes())
        if document is not None:
            return document
    raise NoAnswer(f"{selector}: the answer is not a JSON object")


def json_object(payload: bytes) -> dict[str, Any] | None:
    """The JSON object in ``payload``, None if it is anything else."""
    try:
        document = json.loads(payload)
    except (ValueError, RecursionError):
        return None
    return document if isinstance(document, dict) else None
