"""The database's tables, as SQLAlchemy Core knows them; migrations bring a file to this shape."""

from __future__ import annotations

from datetime import UTC, datetime
from typing import Any

from sqlalchemy import (
    JSON,
    BigInteger,
    Boolean,
    Column,
    DateTime,
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
)

metadata = MetaData(
    naming_convention={
        "ix": "ix_%(table_name)s_%(column_0_N_name)s",
        "uq": "uq_%(table_name)s_%(column_0_N_name)s",
        "fk": "fk_%(table_name)s_%(column_0_name)s",
        "pk": "pk_%(table_name)s",
    }
)


class UtcTime(TypeDecorator[datetime]):
    """A time in UTC on both databases; SQLite alone would drop the zone."""

    impl = DateTime(timezone=True)
    cache_ok = True

    def process_bind_param(self, value: datetime | None, dialect: Any) -> datetime | None:
        return None if value is None else value.astimezone(UTC)

    def process_result_value(self, value: datetime | None, dialect: Any) -> datetime | None:
        if value is None:
            return None
        return value.replace(tzinfo=UTC) if value.tzinfo is None else value.astimezone(UTC)


NAME = String(64)
SHA256 = String(64)
GROWING = BigInteger().with_variant(Integer(), "sqlite")

subjects = Table(
    "subjects",
    metadata,
    Column("name", NAME, primary_key=True),
    Column("title", Text, nullable=False),
    Column("dimensions", JSON, nullable=False),
    Column("created_at", UtcTime, nullable=False),
    Column("hand", String(8), nullable=False, server_default="right"),
)

layouts = Table(
    "layouts",
    metadata,
    Column("name", NAME, primary_key=True),
    Column("document", JSON, nullable=False),
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
    Column("simulated", Boolean, nullable=False),
    Column("meta", JSON, nullable=False),
    Column("run_id", String(32)),
    Column("first_seen_at", UtcTime, nullable=False),
    Column("last_seen_at", UtcTime, nullable=False),
    Column("assigned_at", UtcTime),
    Column("assigned_run_id", String(32)),
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
    Column("sensors", JSON, nullable=False),
    Column("rotations", JSON, nullable=False),
    Column("context", JSON, nullable=False),
    Column("frames", Integer, nullable=False),
    Column("reference_rows", Integer, nullable=False),
    Column("duration_s", Float, nullable=False),
    Column("simulated", Boolean, nullable=False),
    Column("recording", NAME),
    Column("accounting", JSON),
    Column("facts", JSON, nullable=False),
    Column("created_at", UtcTime, nullable=False),
    UniqueConstraint("subject", "layout", "frames_sha256"),
)

models = Table(
    "models",
    metadata,
    Column("id", SHA256, primary_key=True),
    Column("subject", NAME, ForeignKey("subjects.name"), nullable=False),
    Column("layout", NAME, nullable=False),
    Column("method", String(64), nullable=False),
    Column("parent", SHA256),
    Column("facts", JSON, nullable=False),
    Column("created_at", UtcTime, nullable=False),
    Column("row_sha256", SHA256, nullable=False),
    Index(None, "subject", "layout"),
)

model_takes = Table(
    "model_takes",
    metadata,
    Column("model", SHA256, ForeignKey("models.id"), primary_key=True),
    Column("take", NAME, primary_key=True, index=True),
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
    Column("facts", JSON, nullable=False),
    Column("requested_at", UtcTime, nullable=False),
    Column("updated_at", UtcTime, nullable=False),
)

samplings = Table(
    "samplings",
    metadata,
    Column("id", NAME, primary_key=True),
    Column("glove", NAME, nullable=False),
    Column("subject", NAME, ForeignKey("subjects.name"), nullable=False),
    Column("wearing", Text, nullable=False),
    Column("layout", NAME, nullable=False),
    Column("open", Boolean, nullable=False, index=True),
    Column("version", Integer, nullable=False),
    Column("document", JSON, nullable=False),
    Column("recordings", JSON, nullable=False),
    Column("takes", JSON, nullable=False),
    Column("live", JSON, nullable=False),
    Column("problem", Text, nullable=False),
    Column("created_at", UtcTime, nullable=False),
    Column("updated_at", UtcTime, nullable=False),
)

jobs = Table(
    "jobs",
    metadata,
    Column("id", NAME, primary_key=True),
    Column("kind", NAME, nullable=False),
    Column("subject", NAME),
    Column("payload", JSON, nullable=False),
    Column("state", String(16), nullable=False),
    Column("attempt", Integer, nullable=False),
    Column("losses", Integer, nullable=False),
    Column("owner", Text),
    Column("lease_until", Float),
    Column("cancel_requested", Boolean, nullable=False),
    Column("fraction", Float, nullable=False),
    Column("sentence", Text, nullable=False),
    Column("detail", JSON, nullable=False),
    Column("result", JSON),
    Column("error", Text),
    Column("created_at", UtcTime, nullable=False),
    Column("started_at", UtcTime),
    Column("finished_at", UtcTime),
    Column("updated_at", UtcTime, nullable=False),
    Column("traceback", Text),
    Index(None, "state", "created_at"),
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
    Column("detail", JSON, nullable=False),
    Column("created_at", UtcTime, nullable=False),
    Index(None, "job", "id"),
)

revision = Table(
    "revision",
    metadata,
    Column("id", Integer, primary_key=True, autoincrement=False),
    Column("value", BigInteger, nullable=False),
)
