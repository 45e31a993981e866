"""People who log in with a password stand beside the keys: a row has the hash of the one or of the other.

Sessions end: SQLite makes the table anew, which rows of sessions refer to.
"""

import sqlalchemy as sa
from alembic import op

revision = "0010"
down_revision = "0009"


def upgrade() -> None:
    op.execute("DELETE FROM sessions")
    with op.batch_alter_table("keys") as batch:
        batch.alter_column("sha256", existing_type=sa.String(64), nullable=True)
        batch.add_column(sa.Column("password", sa.Text(), nullable=True))
        batch.add_column(sa.Column("password_changed_at", sa.DateTime(timezone=True), nullable=True))
