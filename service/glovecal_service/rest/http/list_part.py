"""How a list is asked for in parts, and how an answer says where the next one begins: of every list alike."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from datetime import datetime
from typing import Annotated, TypeVar

from fastapi import Depends, Query, Request, Response
from pydantic import AfterValidator, AwareDatetime

from glovecal_client.list_part import TOTAL
from glovecal_models.errors import BadInput
from glovecal_service.request_types import ONE_LINE
from glovecal_service.rest.http.problem import warn_of_damaged
from glovecal_service.store.list_part import LONGEST_PLACE, ListPart, Page

USUAL_LIMIT, HIGHEST_LIMIT = 100, 1000
Found = TypeVar("Found")
FIRST_YEAR, LAST_YEAR = 1970, 2200

Limit = Annotated[int, Query(ge=1, le=HIGHEST_LIMIT, description="Rows of one answer, at most.")]
After = Annotated[
    str,
    Query(
        max_length=LONGEST_PLACE, pattern=rf"^$|{ONE_LINE}",
        description="Where to begin, as the `Link` of the answer before has it; empty: at the beginning.",
    ),
]  # fmt: skip
Reverse = Annotated[bool, Query(description="In the other order.")]
Text = Annotated[
    str, Query(max_length=200, pattern=ONE_LINE, description="Only what holds each of these words.")
]


def _within_centuries(moment: datetime) -> datetime:
    """What databases and computers' zones can hold."""
    if not FIRST_YEAR <= moment.year <= LAST_YEAR:
        raise ValueError(f"give a time of the years {FIRST_YEAR} to {LAST_YEAR}")
    return moment


Moment = Annotated[AwareDatetime, AfterValidator(_within_centuries)]


@dataclass(frozen=True)
class Paging:
    """A request for a part of a list, and its answer's headers: `X-Total-Count`, where the rows were counted,
    and where more follow their address in `Link` (RFC 8288)."""

    part: ListPart
    request: Request
    response: Response

    def answer(self, page: Page[Found]) -> list[Found]:
        """The records; damaged rows are named in `Warning` headers."""
        warn_of_damaged(self.response, page.damaged)
        if page.total is not None:
            self.response.headers[TOTAL] = str(page.total)
        if page.after is not None:
            query = self.request.url.include_query_params(limit=self.part.limit, after=page.after).query
            self.response.headers["Link"] = f'<?{query}>; rel="next"'
        return page.records

    def part_of(self, rows: Iterable[Found], key: Callable[[Found], str]) -> list[Found]:
        """Of a list that is not in the database. Raises BadInput for a place where nothing is any more."""
        every = list(rows)
        first = 0
        if self.part.after:
            places = [key(row) for row in every]
            if self.part.after not in places:
                raise BadInput(f"nothing is called {self.part.after!r} any more: begin again, without after")
            first = places.index(self.part.after) + 1
        end = first + (self.part.limit or len(every))
        shown = every[first:end]
        after = key(shown[-1]) if end < len(every) else None
        return self.answer(Page(shown, after=after, total=len(every)))


def _in_parts(request: Request, response: Response, limit: Limit = USUAL_LIMIT, after: After = "") -> Paging:
    return Paging(ListPart(limit, after), request, response)


def _searched(
    request: Request,
    response: Response,
    limit: Limit = USUAL_LIMIT,
    after: After = "",
    reverse: Reverse = False,
    text: Text = "",
) -> Paging:
    return Paging(ListPart(limit, after, reverse, text), request, response)


def _by_time(
    request: Request,
    response: Response,
    limit: Limit = USUAL_LIMIT,
    after: After = "",
    reverse: Reverse = False,
    text: Text = "",
    since: Moment | None = None,
    until: Moment | None = None,
) -> Paging:
    return Paging(ListPart(limit, after, reverse, text, since, until), request, response)


InParts = Annotated[Paging, Depends(_in_parts)]
Searched = Annotated[Paging, Depends(_searched)]
ByTime = Annotated[Paging, Depends(_by_time)]
"""Rows added from `since` on, before `until`."""
