"""Columns whose stored value may be unreadable: the row is reported then, instead of a bare ValueError."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

from sqlalchemy import JSON, Boolean, DateTime, Dialect, TypeDecorator

if TYPE_CHECKING:
    from sqlalchemy.sql.type_api import _ResultProcessorType


@dataclass(frozen=True)
class Unreadable:
    """Stands for a stored value that its column cannot hold."""

    stored: Any

    def __str__(self) -> str:
        return ascii(self.stored)[:80]


@dataclass(frozen=True)
class JsonText:
    """A JSON document and the text it was stored as, which is cheaper to hash than the document."""

    document: Any
    text: str


class _Checked(TypeDecorator[Any]):
    """Gives ``Unreadable`` instead of raising while a result is fetched."""

    __abstract__ = True
    cache_ok = True

    def result_processor(self, dialect: Dialect, coltype: Any) -> _ResultProcessorType[Any] | None:
        read = super().result_processor(dialect, coltype)
        if read is None:
            return None

        def process(value: Any) -> Any:
            try:
                return read(value)
            except (ValueError, TypeError, RecursionError):
                return Unreadable(value)

        return process


class Json(_Checked):
    """A JSON document; where the driver hands out its text (SQLite) a ``JsonText``, None for null."""

    impl = JSON
    cache_ok = True

    def result_processor(self, dialect: Dialect, coltype: Any) -> _ResultProcessorType[Any] | None:
        read = super().result_processor(dialect, coltype)
        if dialect.name != "sqlite" or read is None:
            return read

        def process(value: Any) -> Any:
            document = read(value)
            keeps_text = isinstance(value, str) and not isinstance(document, Unreadable | None)
            return JsonText(document, value) if keeps_text else document

        return process


class UtcTime(_Checked):
    """A time in UTC on both databases; SQLite alone would drop the zone."""

    impl = DateTime(timezone=True)
    cache_ok = True

    def process_bind_param(self, value: datetime | None, dialect: Dialect) -> datetime | None:
        return None if value is None else value.astimezone(UTC)

    def process_result_value(self, value: datetime | None, dialect: Dialect) -> datetime | None:
        if value is None:
            return None
        return value.replace(tzinfo=UTC) if value.tzinfo is None else value.astimezone(UTC)


class Flag(_Checked):
    """True or False; SQLAlchemy alone takes any other number or text for True."""

    impl = Boolean
    cache_ok = True

    def result_processor(self, dialect: Dialect, coltype: Any) -> _ResultProcessorType[Any]:
        def process(value: Any) -> Any:
            if value is None:
                return None
            return bool(value) if value in (0, 1) else Unreadable(value)

        return process
