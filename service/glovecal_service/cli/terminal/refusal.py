"""What went wrong, as one sentence and an exit code."""

from __future__ import annotations

from glovecal_client.errors import ClientError, ServiceError
from glovecal_models.errors import GlovecalError

REFUSED, WRONG_USE, NO_SERVICE, INTERRUPTED = 1, 2, 3, 130


class Refusal(GlovecalError):
    """The command itself found what was asked for impossible."""


class NobodyThere(Refusal):
    """No service, or nothing that would answer."""

    exit_code = NO_SERVICE


def sentence_of(error: Exception) -> str:
    """For a person: without HTTP's status numbers, and with the fields the service found wrong."""
    fields = getattr(error, "problem", {}).get("errors") if isinstance(error, ServiceError) else None
    if fields:
        return "; ".join(f"{_field(item['location'])}{item['problem']}" for item in fields)
    if isinstance(error, ServiceError):
        return error.detail or error.title
    if isinstance(error, OSError):
        named = f"{error.filename}: " if error.filename else ""
        return named + (error.strerror or str(error))
    return str(error)


def exit_code_of(error: Exception) -> int:
    return getattr(error, "exit_code", REFUSED)


def _field(location: str) -> str:
    """``body.rotations.0`` is ``rotations: `` to somebody who never saw the body: the value stands behind."""
    part, *names = location.split(".")
    if part not in ("body", "query", "path", "header"):
        names = [part, *names]
    shown = ", ".join(name for name in names if not name.isdigit())
    return f"{shown}: " if shown else ""


EXPECTED = (GlovecalError, ClientError, OSError)
"""What is told in a sentence; anything else is a mistake of ours and keeps its traceback."""
