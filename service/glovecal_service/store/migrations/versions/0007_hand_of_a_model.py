"""The hand that a model and its activation are of: a subject may have two gloves. Null: nobody said it."""

import sqlalchemy as sa
from alembic import op

revision = "0007"
down_revision = "0006"


def upgrade() -> None:
    op.add_column("models", sa.Column("hand", sa.String(8), nullable=True))
    op.add_column("activations", sa.Column("hand", sa.String(8), nullable=True))
