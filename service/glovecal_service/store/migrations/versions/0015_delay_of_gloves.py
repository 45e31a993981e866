"""How long the live poses of a glove wait for the frames after them."""

import sqlalchemy as sa
from alembic import op

revision = "0015"
down_revision = "0014"


def upgrade() -> None:
    op.add_column("gloves", sa.Column("delay_ms", sa.Integer(), nullable=False, server_default="0"))
