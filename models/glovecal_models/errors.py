"""Every error a caller can meet, drawn as a tree along the question the caller asks.

    GlovecalError
    ├── BadInput            what you gave cannot be used; nothing was changed
    │   ├── BadLayout       a glove's description is wrong
    │   ├── BadTakeTable    a take file is wrong (carries file, line, column)
    │   └── NotTrainable    the samples cannot carry a model (too few, constant, NaN ...)
    ├── DamagedArtifact     a stored file is not what it was when it was written
    ├── LayoutMismatch      readings or takes of one layout given to a model of another
    ├── WorkerDied          a process of a long computation was ended from outside, or could not be started
    └── Cancelled           the user stopped a long computation

Messages name the thing, the value and what would be right.
"""

from __future__ import annotations


class GlovecalError(Exception):
    """Base of all errors raised on purpose by Glovecal."""


class BadInput(GlovecalError, ValueError):
    """What was given cannot be used; nothing was changed."""


class BadLayout(BadInput):
    """A layout names unknown sensors, repeats a name, or cannot be parsed."""


class BadTakeTable(BadInput):
    """A take file cannot be read.

    ``file``, ``line`` (1 is the header), ``column`` and ``value`` (the cell's text) are None where they do
    not apply.
    """

    def __init__(
        self,
        problem: str,
        *,
        file: str | None = None,
        line: int | None = None,
        column: str | None = None,
        value: str | None = None,
    ) -> None:
        place = ", ".join(
            text
            for text in (
                file,
                f"line {line}" if line is not None else None,
                f"column {column!r}" if column is not None else None,
            )
            if text
        )
        super().__init__(f"{place}: {problem}" if place else problem)
        self.problem = problem
        self.file = file
        self.line = line
        self.column = column
        self.value = value


class NotTrainable(BadInput):
    """The samples cannot carry a calibration model."""


class DamagedArtifact(GlovecalError):
    """A stored file is not what it was when it was written."""


class LayoutMismatch(BadInput):
    """Readings or takes of one layout were given to a model of another."""


class WorkerDied(GlovecalError):
    """A worker process was ended from outside (memory ran out), or could not be started."""


class Cancelled(GlovecalError):
    """The user stopped a long computation."""


def reason_of(error: BaseException) -> str:
    """What a person can be told of an error: our own sentence, or the operating system's words for what it
    refused. Of anything else only the kind; its text is for the log and for the traceback."""
    if isinstance(error, GlovecalError):
        return str(error)
    if isinstance(error, OSError) and error.strerror:
        return error.strerror
    return f"an unforeseen {type(error).__name__}"
