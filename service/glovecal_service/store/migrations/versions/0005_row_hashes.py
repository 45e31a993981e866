"""A hash in every row of takes, model takes, recordings, samplings and jobs, of what stands there now.

Models and activations had one that held their NULLs too; a sound row of theirs is hashed anew without. A row
that cannot be read or was damaged before gets no valid hash: it is reported when it is read.
"""

import hashlib
import json
from datetime import UTC, datetime

import sqlalchemy as sa
from alembic import op
from sqlalchemy.exc import NoResultFound

revision = "0005"
down_revision = "0004"

NEW = ("takes", "model_takes", "recordings", "samplings", "jobs")
HASHED_BEFORE = ("models", "activations")
NUMBERED_BY_THE_DATABASE = {"activations": "id"}


def upgrade() -> None:
    for name in NEW:
        op.add_column(name, sa.Column("row_sha256", sa.String(64), nullable=False, server_default=""))
    for name in (*NEW, *HASHED_BEFORE):
        _hash_rows(op.get_bind(), name)


def _hash_rows(connection: sa.Connection, name: str) -> None:
    table = sa.Table(name, sa.MetaData(), autoload_with=connection)
    keys = list(table.primary_key.columns)
    for key in connection.execute(sa.select(*keys)).all():
        same = [column == value for column, value in zip(keys, key, strict=True)]
        try:
            values = dict(connection.execute(sa.select(table).where(*same)).one()._mapping)
            before = values.pop("row_sha256")
            values.pop(NUMBERED_BY_THE_DATABASE.get(name, ""), None)
            if name in HASHED_BEFORE and _sha256(name, values) != before:
                continue
            present = {column: value for column, value in values.items() if value is not None}
            digest = _sha256(name, present)
        except (ValueError, TypeError, RecursionError, NoResultFound):
            continue
        connection.execute(sa.update(table).where(*same).values(row_sha256=digest))


def _sha256(name: str, values: dict) -> str:
    plain = {column: _plain(value) for column, value in values.items()}
    text = json.dumps([name, plain], allow_nan=False, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode("ascii")).hexdigest()


def _plain(value: object) -> object:
    if isinstance(value, datetime):
        return (value.replace(tzinfo=UTC) if value.tzinfo is None else value.astimezone(UTC)).isoformat()
    return value
