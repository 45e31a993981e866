"""Long lists on the command line: the newest rows, and how to see the others."""

from __future__ import annotations

import shlex
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Annotated, Any

import typer

from glovecal_service.cli.terminal.printing import err, print_json
from glovecal_service.plain import Found, read

if TYPE_CHECKING:
    from glovecal_client.rest import RestClient

SHOWN = 40


def _moment(value: str | None) -> str | None:
    """A typer callback: a day or time by this computer's clock, as REST takes it."""
    if value is None:
        return None
    try:
        moment = datetime.fromisoformat(value)
        return moment.astimezone(UTC).isoformat()
    except (ValueError, OverflowError) as error:
        raise typer.BadParameter(
            f"{value!r} is no day or time; write it like 2026-11-27 or 2026-11-27T14:30"
        ) from error


MostRows = Annotated[
    int | None, typer.Option("--limit", "-n", min=1, max=1000, help=f"So many rows; {SHOWN} unless --json.")
]
EveryRow = Annotated[bool, typer.Option("--all", help="Every row.")]
AfterPlace = Annotated[
    str | None, typer.Option("--after", help="Go on where an earlier list ended, as it said.")
]
Words = Annotated[str | None, typer.Option("--text", help="Only what holds each of these words.")]
Since = Annotated[
    str | None, typer.Option("--since", help="Only from this day or time on.", callback=_moment)
]


@dataclass(frozen=True)
class Wanted:
    """Which part of a list."""

    limit: int | None
    every: bool
    after: str | None
    as_json: bool

    def rows(
        self,
        service: RestClient,
        kind: type[Found],
        path: str,
        command: str,
        query: dict[str, Any],
        *,
        newest_last: bool = False,
    ) -> list[Found]:
        """``command``: the verb with its filters. With ``as_json`` they are printed, and the verb ends.

        ``newest_last``: the list is in the order in which its rows were added, and its newest part is shown.
        """
        is_whole = self.every or (self.as_json and self.limit is None and self.after is None)
        if is_whole:
            rows = service.get(path, query)
        else:
            asked = {**query, "limit": self.limit or SHOWN, "after": self.after}
            part = service.part(path, asked | ({"reverse": True} if newest_last else {}))
            rows = part.rows[::-1] if newest_last else part.rows
            if part.after is not None and not self.as_json:
                _tell_rest(len(rows), part.total, f"{command} --after {shlex.quote(part.after)}")
        if self.as_json:
            print_json(rows)
            raise typer.Exit
        return read(list[kind], rows)


def _tell_rest(shown: int, total: int | None, command: str) -> None:
    of_all = "there are more" if total is None else f"{total:,} in all"
    err.print(f"{shown} rows, {of_all}; --all lists every one.\nNext: glovecal {command}")


def filtered(command: str, **filters: str | bool | None) -> str:
    """The verb as it was called."""
    given = [
        f"--{name.replace('_', '-')}" + ("" if value is True else f" {shlex.quote(str(value))}")
        for name, value in filters.items()
        if value
    ]
    return " ".join([command, *given])
