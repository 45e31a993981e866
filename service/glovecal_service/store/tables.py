"""The database's tables, as SQLAlchemy Core knows them; migrations bring a file to this shape.

A stored value that its column cannot hold is reported as unreadable, instead of a bare ValueError.
A column ``row_sha256`` protects a table: ``row_hash.py`` writes and checks it.
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

from sqlalchemy import (
    JSON,
    BigInteger,
    Boolean,
    Column,
    DateTime,
    Dialect,
    Float,
    ForeignKey,
    Index,
    Integer,
    MetaData,
    String,
    Table,
    Text,
    TypeDecorator,
    UniqueConstraint,
    text,
)

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


metadata = MetaData(
    naming_convention={
        "ix": "ix_%(table_name)s_%(column_0_N_name)s",
        "uq": "uq_%(table_name)s_%(column_0_N_name)s",
        "fk": "fk_%(table_name)s_%(column_0_name)s",
        "pk": "pk_%(table_name)s",
    }
)


NAME = String(64)
SHA256 = String(64)
GROWING = BigInteger().with_variant(Integer(), "sqlite")

subjects = Table(
    "subjects",
    metadata,
    Column("name", NAME, primary_key=True),
    Column("title", Text, nullable=False),
    Column("dimensions", Json, nullable=False),
    Column("created_at", UtcTime, nullable=False),
    Column("hand", String(8), nullable=False, server_default="right"),
)

layouts = Table(
    "layouts",
    metadata,
    Column("name", NAME, primary_key=True),
    Column("document", Json, nullable=False),
    Column("created_at", UtcTime, nullable=False),
)

gloves = Table(
    "gloves",
    metadata,
    Column("name", NAME, primary_key=True),
    Column("layout", NAME),
    Column("subject", NAME),
    Column("wearing", Text),
    Column("hand", String(16), nullable=False),
    Column("simulated", Flag, nullable=False),
    Column("meta", Json, nullable=False),
    Column("run_id", String(32)),
    Column("first_seen_at", UtcTime, nullable=False),
    Column("last_seen_at", UtcTime, nullable=False),
    Column("assigned_at", UtcTime),
    Column("assigned_run_id", String(32)),
    Column("latency", Json),
    Column("delay_ms", Integer, nullable=False, server_default="0"),
)

takes = Table(
    "takes",
    metadata,
    Column("id", NAME, primary_key=True),
    Column("name", Text, nullable=False),
    Column("subject", NAME, ForeignKey("subjects.name"), nullable=False),
    Column("layout", NAME, nullable=False),
    Column("wearing", Text, nullable=False),
    Column("source", String(64), nullable=False),
    Column("artifact", SHA256, nullable=False),
    Column("frames_sha256", SHA256, nullable=False),
    Column("original_sha256", SHA256),
    Column("sensors", Json, nullable=False),
    Column("rotations", Json, nullable=False),
    Column("context", Json, nullable=False),
    Column("frames", Integer, nullable=False),
    Column("reference_rows", Integer, nullable=False),
    Column("duration_s", Float, nullable=False),
    Column("simulated", Flag, nullable=False),
    Column("recording", NAME),
    Column("accounting", Json),
    Column("facts", Json, nullable=False),
    Column("created_at", UtcTime, nullable=False),
    Column("row_sha256", SHA256, nullable=False, server_default=""),
    UniqueConstraint("subject", "layout", "frames_sha256"),
    Index(None, "recording"),
    Index(None, "created_at", "id"),
    Index(None, "subject", "created_at", "id"),
)

IS_REMOVED = {
    "sqlite": """instr(facts, '"removed_at":') > 0""",
    "postgresql": "(facts ->> 'removed_at') IS NOT NULL",
}
"""Of a model, by dialect: the condition of an index, which statements have to repeat to the letter."""

models = Table(
    "models",
    metadata,
    Column("id", SHA256, primary_key=True),
    Column("subject", NAME, ForeignKey("subjects.name"), nullable=False),
    Column("layout", NAME, nullable=False),
    Column("method", String(64), nullable=False),
    Column("parent", SHA256),
    Column("facts", Json, nullable=False),
    Column("created_at", UtcTime, nullable=False),
    Column("hand", String(8)),
    Column("row_sha256", SHA256, nullable=False),
    Index(None, "subject", "layout", "hand"),
    Index(None, "created_at", "id"),
    Index(None, "subject", "created_at", "id"),
    Index(
        "ix_models_removed",
        "created_at",
        "id",
        sqlite_where=text(IS_REMOVED["sqlite"]),
        postgresql_where=text(IS_REMOVED["postgresql"]),
    ),
)

model_takes = Table(
    "model_takes",
    metadata,
    Column("model", SHA256, ForeignKey("models.id"), primary_key=True),
    Column("take", NAME, primary_key=True, index=True),
    Column("row_sha256", SHA256, nullable=False, server_default=""),
)

activations = Table(
    "activations",
    metadata,
    Column("id", GROWING, primary_key=True, autoincrement=True),
    Column("subject", NAME, ForeignKey("subjects.name"), nullable=False),
    Column("layout", NAME, nullable=False),
    Column("model", SHA256, ForeignKey("models.id"), nullable=False),
    Column("kind", String(16), nullable=False),
    Column("previous", GROWING),
    Column("created_at", UtcTime, nullable=False),
    Column("hand", String(8)),
    Column("row_sha256", SHA256, nullable=False),
    Index(None, "subject", "layout", "id"),
)

recordings = Table(
    "recordings",
    metadata,
    Column("id", NAME, primary_key=True),
    Column("glove", NAME, nullable=False, index=True),
    Column("name", Text, nullable=False),
    Column("subject", NAME),
    Column("wearing", Text),
    Column("state", String(16), nullable=False, index=True),
    Column("facts", Json, nullable=False),
    Column("requested_at", UtcTime, nullable=False),
    Column("updated_at", UtcTime, nullable=False),
    Column("row_sha256", SHA256, nullable=False, server_default=""),
    Index(None, "requested_at", "id"),
    Index(None, "glove", "requested_at", "id"),
    Index(None, "subject", "requested_at", "id"),
)

samplings = Table(
    "samplings",
    metadata,
    Column("id", NAME, primary_key=True),
    Column("glove", NAME, nullable=False),
    Column("subject", NAME, ForeignKey("subjects.name"), nullable=False),
    Column("wearing", Text, nullable=False),
    Column("layout", NAME, nullable=False),
    Column("open", Flag, nullable=False, index=True),
    Column("version", Integer, nullable=False),
    Column("document", Json, nullable=False),
    Column("recordings", Json, nullable=False),
    Column("takes", Json, nullable=False),
    Column("live", Json, nullable=False),
    Column("problem", Text, nullable=False),
    Column("created_at", UtcTime, nullable=False),
    Column("updated_at", UtcTime, nullable=False),
    Column("row_sha256", SHA256, nullable=False, server_default=""),
    Index(None, "created_at", "id"),
)

jobs = Table(
    "jobs",
    metadata,
    Column("id", NAME, primary_key=True),
    Column("kind", NAME, nullable=False),
    Column("subject", NAME),
    Column("payload", Json, nullable=False),
    Column("state", String(16), nullable=False),
    Column("attempt", Integer, nullable=False),
    Column("losses", Integer, nullable=False),
    Column("owner", Text),
    Column("lease_until", Float),
    Column("cancel_requested", Flag, nullable=False),
    Column("fraction", Float, nullable=False),
    Column("sentence", Text, nullable=False),
    Column("detail", Json, nullable=False),
    Column("result", Json),
    Column("error", Text),
    Column("created_at", UtcTime, nullable=False),
    Column("started_at", UtcTime),
    Column("finished_at", UtcTime),
    Column("updated_at", UtcTime, nullable=False),
    Column("traceback", Text),
    Column("row_sha256", SHA256, nullable=False, server_default=""),
    Index(None, "state", "created_at"),
    Index(None, "created_at", "id"),
    Index(None, "subject", "created_at", "id"),
    Index(None, "finished_at"),
)

job_events = Table(
    "job_events",
    metadata,
    Column("id", GROWING, primary_key=True, autoincrement=True),
    Column("job", NAME, ForeignKey("jobs.id", ondelete="CASCADE"), nullable=False),
    Column("attempt", Integer, nullable=False),
    Column("state", String(16), nullable=False),
    Column("fraction", Float, nullable=False),
    Column("sentence", Text, nullable=False),
    Column("detail", Json, nullable=False),
    Column("created_at", UtcTime, nullable=False),
    Index(None, "job", "id"),
)

revision = Table(
    "revision",
    metadata,
    Column("id", Integer, primary_key=True, autoincrement=False),
    Column("value", BigInteger, nullable=False),
)

changes = Table(
    "changes",
    metadata,
    Column("kind", String(16), primary_key=True),
    Column("name", NAME, primary_key=True),
    Column("revision", BigInteger, nullable=False),
    Index(None, "revision"),
)
"""At which revision a thing changed last."""

keys = Table(
    "keys",
    metadata,
    Column("name", NAME, primary_key=True),
    Column("sha256", SHA256),
    Column("role", String(16), nullable=False),
    Column("subjects", Json),
    Column("created_at", UtcTime, nullable=False),
    Column("revoked_at", UtcTime),
    Column("password", Text),
    Column("password_changed_at", UtcTime),
    Column("issuer", Text),
    Column("issuer_sub", Text),
    Column("row_sha256", SHA256, nullable=False),
    UniqueConstraint("sha256"),
    UniqueConstraint("issuer", "issuer_sub", name="keys_issuer_issuer_sub_key"),
)
"""Of a key ``sha256``, of a person ``password`` (PHC format), or who they are to a provider of OpenID Connect
(claims ``iss`` and ``sub``)."""

sessions = Table(
    "sessions",
    metadata,
    Column("sha256", SHA256, primary_key=True),
    Column("key", NAME, ForeignKey("keys.name"), nullable=False),
    Column("expires_at", UtcTime, nullable=False),
)

erasures = Table(
    "erasures",
    metadata,
    Column("id", NAME, primary_key=True),
    Column("files", Json, nullable=False),
    Column("began_at", UtcTime, nullable=False),
    Column("finished_at", UtcTime),
)
"""Of subjects that are gone: files that are still to be removed, none once it is finished."""

shared_files = Table(
    "shared_files",
    metadata,
    Column("file", String(200), primary_key=True),
    Column("sha256", SHA256),
    Column("size_bytes", BigInteger, nullable=False),
    Column("changed_at", UtcTime, nullable=False),
    Column("row_sha256", SHA256, nullable=False),
)
"""Files of the data folder that lie in the object store as well, by their path: the hash of what they hold,
NULL once they are gone, and their size as they lie there."""

audit = Table(
    "audit",
    metadata,
    Column("id", GROWING, primary_key=True, autoincrement=False),
    Column("at", UtcTime, nullable=False),
    Column("who", Text, nullable=False),
    Column("origin", Text, nullable=False),
    Column("action", Text, nullable=False),
    Column("changes", Json, nullable=False),
    Column("previous", SHA256, nullable=False),
    Column("sha256", SHA256, nullable=False),
)

damages = Table(
    "damages",
    metadata,
    Column("table", NAME, primary_key=True),
    Column("id", String(200), primary_key=True),
    Column("subject", NAME),
    Column("sentence", Text, nullable=False),
    Column("found_at", UtcTime, nullable=False),
    Index(None, "found_at"),
)
"""What the search for damage found, until it is sound again or gone."""

audit_head = Table(
    "audit_head",
    metadata,
    Column("id", Integer, primary_key=True, autoincrement=False),
    Column("count", GROWING, nullable=False),
    Column("sha256", SHA256, nullable=False),
)
