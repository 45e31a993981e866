"""How a list is asked for in parts, and how an answer says what comes after it."""

from __future__ import annotations

from typing import Annotated

from fastapi import Depends, Query, Request, Response

from glovecal_service.plain import TOTAL
from glovecal_service.request_types import ONE_LINE
from glovecal_service.store.list_part import ListPart

USUAL_LIMIT, HIGHEST_LIMIT = 500, 5000
HIGHEST_OFFSET = 10**9


def _part(
    limit: Annotated[int, Query(ge=1, le=HIGHEST_LIMIT, description="Rows of one answer, at most.")] = (
        USUAL_LIMIT
    ),
    offset: Annotated[int, Query(ge=0, le=HIGHEST_OFFSET, description="Rows to leave out before them.")] = 0,
    reverse: Annotated[bool, Query(description="In the other order.")] = False,
    text: Annotated[
        str, Query(max_length=200, pattern=ONE_LINE, description="Only what holds each of these words.")
    ] = "",
) -> ListPart:
    return ListPart(limit, offset, reverse, text)


PartWanted = Annotated[ListPart, Depends(_part)]


def tell_rest(request: Request, response: Response, part: ListPart, total: int) -> None:
    """`X-Total-Count`, and where more rows follow, their address in `Link` (RFC 8288)."""
    response.headers[TOTAL] = str(total)
    after = part.offset + (part.limit or 0)
    if after < total:
        query = request.url.include_query_params(limit=part.limit, offset=after).query
        response.headers["Link"] = f'<?{query}>; rel="next"'
