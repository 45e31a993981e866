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
    documents = {column.name for column in table.columns if isinstance(column.type, sa.JSON)}
    columns = [
        sa.cast(item, sa.Text).label(item.name) if item.name in documents else item for item in table.columns
    ]
    keys = list(table.primary_key.columns)
    for key in connection.execute(sa.select(*keys)).all():
        same = [column == value for column, value in zip(keys, key, strict=True)]
        try:
            row = connection.execute(sa.select(*columns).where(*same)).one()._mapping
            values = {column: _plain(value) for column, value in row.items()}
            before = values.pop("row_sha256")
            values.pop(NUMBERED_BY_THE_DATABASE.get(name, ""), None)
            parsed = {
                column: json.loads(str(values[column])) for column in documents & _present(values).keys()
            }
            if name in HASHED_BEFORE and _sha256(name, values | parsed) != before:
                continue
            if connection.dialect.name != "sqlite":  # there the text is made anew from what the driver parsed
                values |= {column: _json(document) for column, document in parsed.items()}
            nothing = {column: None for column, document in parsed.items() if document is None}
            digest = _sha256(name, _present(values | nothing))
        except (ValueError, TypeError, RecursionError, NoResultFound):
            continue
        connection.execute(sa.update(table).where(*same).values(row_sha256=digest))


def _present(values: dict) -> dict:
    return {column: value for column, value in values.items() if value is not None}


def _sha256(name: str, values: dict) -> str:
    return hashlib.sha256(_json([name, values], sort_keys=True).encode("ascii")).hexdigest()


def _json(value: object, *, sort_keys: bool = False) -> str:
    return json.dumps(value, allow_nan=False, sort_keys=sort_keys, separators=(",", ":"))


def _plain(value: object) -> object:
    if isinstance(value, datetime):
        return (value.replace(tzinfo=UTC) if value.tzinfo is None else value.astimezone(UTC)).isoformat()
    return value
