"""People whom a provider of OpenID Connect knows: a row has the provider and who it says they are.

Sessions end: SQLite makes the table anew, which rows of sessions refer to.
"""

import sqlalchemy as sa
from alembic import op

revision = "0011"
down_revision = "0010"


def upgrade() -> None:
    op.execute("DELETE FROM sessions")
    with op.batch_alter_table("keys") as batch:
        batch.add_column(sa.Column("issuer", sa.Text(), nullable=True))
        batch.add_column(sa.Column("issuer_sub", sa.Text(), nullable=True))
        batch.create_unique_constraint("keys_issuer_issuer_sub_key", ["issuer", "issuer_sub"])
