"""A glove's latency, measured with taps on a key."""

import sqlalchemy as sa
from alembic import op

revision = "0006"
down_revision = "0005"


def upgrade() -> None:
    op.add_column("gloves", sa.Column("latency", sa.JSON(), nullable=True))
