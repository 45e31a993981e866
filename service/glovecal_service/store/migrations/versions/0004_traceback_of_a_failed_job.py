"""A failed job keeps the Python traceback of an error that nobody foresaw."""

import sqlalchemy as sa
from alembic import op

revision = "0004"
down_revision = "0003"


def upgrade() -> None:
    op.add_column("jobs", sa.Column("traceback", sa.Text(), nullable=True))
