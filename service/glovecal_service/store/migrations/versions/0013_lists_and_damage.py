"""Indices that long lists are read by, and what is known to be damaged."""

import sqlalchemy as sa
from alembic import op

revision = "0013"
down_revision = "0012"

NAME = sa.String(64)
INDICES = {
    "takes": (("recording",), ("created_at", "id"), ("subject", "created_at", "id")),
    "models": (("subject", "layout", "hand"), ("created_at", "id"), ("subject", "created_at", "id")),
    "recordings": (
        ("requested_at", "id"),
        ("glove", "requested_at", "id"),
        ("subject", "requested_at", "id"),
    ),
    "samplings": (("created_at", "id"),),
    "jobs": (("created_at", "id"), ("subject", "created_at", "id"), ("finished_at",)),
}


def upgrade() -> None:
    op.create_table(
        "damages",
        sa.Column("table", NAME, nullable=False),
        sa.Column("id", sa.String(200), nullable=False),
        sa.Column("subject", NAME, nullable=True),
        sa.Column("sentence", sa.Text(), nullable=False),
        sa.Column("found_at", sa.DateTime(timezone=True), nullable=False),
        sa.PrimaryKeyConstraint("table", "id", name="pk_damages"),
    )
    op.create_index("ix_damages_found_at", "damages", ["found_at"])
    op.drop_index("ix_models_subject_layout", "models")
    for table, indices in INDICES.items():
        for columns in indices:
            op.create_index(f"ix_{table}_{'_'.join(columns)}", table, list(columns))
    op.create_index(
        "ix_models_removed",
        "models",
        ["created_at", "id"],
        sqlite_where=sa.text("""instr(facts, '"removed_at":') > 0"""),
        postgresql_where=sa.text("(facts ->> 'removed_at') IS NOT NULL"),
    )
