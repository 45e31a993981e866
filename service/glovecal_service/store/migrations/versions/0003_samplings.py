"""Guided samplings: where each stands, as one document."""

import sqlalchemy as sa
from alembic import op

revision = "0003"
down_revision = "0002"

NAME = sa.String(64)
TIME = sa.DateTime(timezone=True)


def upgrade() -> None:
    op.create_table(
        "samplings",
        sa.Column("id", NAME, nullable=False),
        sa.Column("glove", NAME, nullable=False),
        sa.Column("subject", NAME, nullable=False),
        sa.Column("wearing", sa.Text(), nullable=False),
        sa.Column("layout", NAME, nullable=False),
        sa.Column("open", sa.Boolean(), nullable=False),
        sa.Column("version", sa.Integer(), nullable=False),
        sa.Column("document", sa.JSON(), nullable=False),
        sa.Column("recordings", sa.JSON(), nullable=False),
        sa.Column("takes", sa.JSON(), nullable=False),
        sa.Column("live", sa.JSON(), nullable=False),
        sa.Column("problem", sa.Text(), nullable=False),
        sa.Column("created_at", TIME, nullable=False),
        sa.Column("updated_at", TIME, nullable=False),
        sa.ForeignKeyConstraint(["subject"], ["subjects.name"], name="fk_samplings_subject"),
        sa.PrimaryKeyConstraint("id", name="pk_samplings"),
    )
    op.create_index("ix_samplings_open", "samplings", ["open"])
