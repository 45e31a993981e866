"""Which hand a subject's dimensions and gloves are of."""

import sqlalchemy as sa
from alembic import op

revision = "0002"
down_revision = "0001"


def upgrade() -> None:
    op.add_column("subjects", sa.Column("hand", sa.String(8), nullable=False, server_default="right"))
