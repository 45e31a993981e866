"""The columns of a take table: which names are allowed, what they hold, and what was probably meant."""

from __future__ import annotations

import difflib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from glovecal_models.errors import BadInput, BadTakeTable
from glovecal_models.names import check_channel_name

ColumnKind = Literal["time", "take", "wearing", "pose", "sensor", "rotation", "context"]
MOST_COLUMNS = 1000
_PLAIN: dict[str, ColumnKind] = {"time_s": "time", "take": "take", "wearing": "wearing", "pose": "pose"}
_PREFIXED: dict[str, ColumnKind] = {"s": "sensor", "r": "rotation", "c": "context"}
_ALLOWED = "time_s, take, wearing, pose, s.<SENSOR>, r.<ROTATION> and c.<CONTEXT>"
_TIME_LIKE = {"time", "t", "timestamp", "seconds", "second", "time_sec", "times", "time_ms", "ms", "time(s)"}


@dataclass(frozen=True)
class Column:
    """One column: its header, what kind of values it holds, and the channel's name."""

    header: str
    kind: ColumnKind
    name: str

    @property
    def is_text(self) -> bool:
        return self.kind in ("take", "wearing", "pose")

    @property
    def may_be_empty(self) -> bool:
        """Angles and context may be missing in a row; times and readings may not."""
        return self.kind in ("rotation", "context")


def parse_header(headers: Sequence[str], file: str) -> list[Column]:
    """The columns of a table, in order. Raises BadTakeTable for an unknown, repeated or missing one."""
    if len(headers) > MOST_COLUMNS:
        raise BadTakeTable(f"{len(headers)} columns; at most {MOST_COLUMNS} are read", file=file, line=1)
    columns = [_parse_column(header.strip(), place, file) for place, header in enumerate(headers, start=1)]
    seen: set[str] = set()
    for column in columns:
        if column.header in seen:
            raise BadTakeTable(
                "this column stands twice; remove or rename one", file=file, line=1, column=column.header
            )
        seen.add(column.header)
    if "time_s" not in seen:
        raise BadTakeTable(f"there is no column time_s; columns are {_ALLOWED}", file=file, line=1)
    return columns


def _parse_column(header: str, place: int, file: str) -> Column:
    if not header:
        raise BadTakeTable(f"column {place} has no name; columns are {_ALLOWED}", file=file, line=1)
    if header in _PLAIN:
        return Column(header, _PLAIN[header], header)
    prefix, dot, name = header.partition(".")
    if not dot or prefix not in _PREFIXED:
        raise BadTakeTable(
            f"unknown column; {_what_was_meant(header)}", file=file, line=1, column=header[:80]
        )
    try:
        check_channel_name(name, _PREFIXED[prefix])
    except BadInput as error:
        raise BadTakeTable(str(error), file=file, line=1, column=header[:80]) from error
    return Column(header, _PREFIXED[prefix], name)


def _what_was_meant(header: str) -> str:
    prefix, dot, name = header.partition(".")
    near_prefix = next((known for known in _PREFIXED if prefix[:1].lower() == known), None)
    if dot and name and near_prefix:
        return f"did you mean {near_prefix}.{name[:80]}?"
    if header.lower() in _TIME_LIKE:
        return "did you mean time_s (in seconds)?"
    near = difflib.get_close_matches(header.lower(), _PLAIN, n=1)
    if near:
        return f"did you mean {near[0]}?"
    if not dot and header.isidentifier():
        return f"write s.{header[:80]} for raw readings or r.{header[:80]} for reference angles"
    return f"columns are {_ALLOWED}"
