"""What the service's processes write of themselves, on standard error: with names, or without.

Names are of people: those of subjects, gloves, takes and files, and whatever sentence has one in it. Without
them (``GLOVECAL_LOG_NAMES=no``) a line keeps what this program itself wrote, numbers, ids that the service
made and ``Word``; every other text is a mark, the same for the same text, by which lines can be told apart.
Errors keep their kind and the places in the code that they came through. What libraries log keeps its
numbers; a line of theirs that was put together before it came here is left out.
"""

from __future__ import annotations

import hashlib
import hmac
import json
import logging
import re
import secrets
import sys
import threading
import traceback
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from glovecal_client.operating_system import move_over
from glovecal_client.private_files import open_private
from glovecal_client.program import never_wait
from glovecal_models.errors import BadInput, reason_of

if TYPE_CHECKING:
    from glovecal_service.settings import Settings

KEY_FILE = "log-marks.key"
"""In the data folder: who has it and a name can make the name's mark."""
_KEY_BYTES = 32
_MARK_DIGITS = 8
_MADE_HERE = re.compile(r"(?=[0-9]*[a-f])[0-9a-f]{12,64}|[0-9a-f]{8}(-[0-9a-f]{4}){3}-[0-9a-f]{12}")
"""Ids of rows and hashes. Of digits alone it may be a person's number."""
_OURS = ("glovecal", "glovecal_client", "glovecal_models", "glovecal_service")
_CHATTY = ("alembic", "uvicorn.error", "httpx")
_FORMAT = "%(asctime)s %(name)s %(levelname)s %(message)s"


class Word(str):
    """A text of this program's own that names nobody, such as a state."""

    __slots__ = ()


class Event:
    """One event as JSON. ``named``: what may name somebody."""

    def __init__(self, event: str, named: Mapping[str, Any], **facts: Any) -> None:
        self._facts, self._named = {"event": event, **facts}, named

    def __str__(self) -> str:
        return json.dumps({**self._facts, **self._named})

    def without_names(self) -> str:
        return json.dumps(self._facts)


def log_to_stderr(settings: Settings) -> Callable[[], None]:
    """Returns what waits until all is written. A process that was forked has its parent's handler.

    Raises BadInput where names are left out and the key of their marks can be neither read nor made.
    """
    formatter = logging.Formatter(_FORMAT) if settings.log_names else NamelessFormatter(marks(settings.data))
    settle = never_wait()
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(formatter)
    logging.basicConfig(level=logging.INFO, handlers=[handler], force=True)
    for chatty in _CHATTY:
        logging.getLogger(chatty).setLevel(logging.WARNING)
    if not settings.log_names:
        sys.excepthook = _log_end
        threading.excepthook = lambda ended: _log_end(
            ended.exc_type, ended.exc_value or ended.exc_type(), ended.exc_traceback
        )
    return settle


def marks(data: Path) -> Callable[[str], str]:
    """What makes the mark of a text, the same in all processes and after each start. Raises BadInput."""
    file = data / KEY_FILE
    try:
        key = file.read_bytes() if file.exists() else _made_key(file)
    except OSError as error:
        raise BadInput(
            f"the key of the marks in the log, {KEY_FILE} in the data folder, can be neither read nor made "
            f"({reason_of(error)}); let the service's user read it, or log with names: GLOVECAL_LOG_NAMES=yes"
        ) from error
    return lambda text: (
        f"~{hmac.new(key, text.encode('utf-8', 'replace'), hashlib.sha256).hexdigest()[:_MARK_DIGITS]}"
    )


def _made_key(file: Path) -> bytes:
    key = secrets.token_bytes(_KEY_BYTES)
    file.parent.mkdir(parents=True, exist_ok=True)
    unfinished = file.with_name(f"{file.name}.{secrets.token_hex(4)}")
    with open(unfinished, "xb", opener=open_private) as made:
        made.write(key)
    move_over(unfinished, file, durably=True)
    return key


class NamelessFormatter(logging.Formatter):
    """Lines in which nobody is named."""

    def __init__(self, mark: Callable[[str], str]) -> None:
        super().__init__(_FORMAT)
        self._mark = mark

    def format(self, record: logging.LogRecord) -> str:
        shown = logging.makeLogRecord({**vars(record), "args": None, "exc_text": None, "stack_info": None})
        shown.msg = self._message(record)
        return super().format(shown)

    def formatException(self, ei: Any) -> str:  # noqa: N802  as the library calls it
        return "\n".join(_places(ei[1])) if ei[1] is not None else ""

    def _message(self, record: logging.LogRecord) -> str:
        is_ours = record.name.partition(".")[0] in _OURS
        if not isinstance(record.msg, str) or not (is_ours or record.args):
            return f"what {record.name} says is left out, as it may name somebody"
        if isinstance(record.args, Mapping):
            return record.msg % {name: self._of(value) for name, value in record.args.items()}
        return record.msg % tuple(map(self._of, record.args or ()))

    def _of(self, value: Any) -> Any:
        if value is None or isinstance(value, bool | int | float | Word):
            return value
        if isinstance(value, Event):
            return value.without_names()
        text = str(value)
        if isinstance(value, BaseException):
            return f"{type(value).__name__} {self._mark(text)}"
        return text if _MADE_HERE.fullmatch(text) else self._mark(text)


def _log_end(kind: type[BaseException], error: BaseException, trace: Any) -> None:
    logging.getLogger("glovecal").error("a thread or process ended", exc_info=(kind, error, trace))


def _places(error: BaseException) -> Iterator[str]:
    """The kinds of an error and of what caused it, and where in the code they came from, the last first."""
    told: set[int] = set()
    cause: BaseException | None = error
    while cause is not None and id(cause) not in told:
        told.add(id(cause))
        yield f"{type(cause).__name__}, from:"
        for frame, line in traceback.walk_tb(cause.__traceback__):
            yield f"  {frame.f_globals.get('__name__', '?')}:{line}, {frame.f_code.co_name}"
        cause = cause.__cause__ or (None if cause.__suppress_context__ else cause.__context__)
