"""The first schema that is upgraded by later ones; those with lower numbers were never released."""

import sqlalchemy as sa
from alembic import op

revision = "0007"
down_revision = None

NAME = sa.String(64)
TIME = sa.DateTime(timezone=True)
GROWING = sa.BigInteger().with_variant(sa.Integer(), "sqlite")


def upgrade() -> None:
    op.create_table(
        "gloves",
        sa.Column("name", NAME, nullable=False),
        sa.Column("layout", NAME, nullable=True),
        sa.Column("subject", NAME, nullable=True),
        sa.Column("wearing", sa.Text(), nullable=True),
        sa.Column("hand", sa.String(length=16), nullable=False),
        sa.Column("simulated", sa.Boolean(), nullable=False),
        sa.Column("meta", sa.JSON(), nullable=False),
        sa.Column("run_id", sa.String(length=32), nullable=True),
        sa.Column("first_seen_at", TIME, nullable=False),
        sa.Column("last_seen_at", TIME, nullable=False),
        sa.Column("assigned_at", TIME, nullable=True),
        sa.Column("assigned_run_id", sa.String(length=32), nullable=True),
        sa.Column("latency", sa.JSON(), nullable=True),
        sa.PrimaryKeyConstraint("name", name="pk_gloves"),
    )
    op.create_table(
        "jobs",
        sa.Column("id", NAME, nullable=False),
        sa.Column("kind", NAME, nullable=False),
        sa.Column("subject", NAME, nullable=True),
        sa.Column("payload", sa.JSON(), nullable=False),
        sa.Column("state", sa.String(length=16), nullable=False),
        sa.Column("attempt", sa.Integer(), nullable=False),
        sa.Column("losses", sa.Integer(), nullable=False),
        sa.Column("owner", sa.Text(), nullable=True),
        sa.Column("lease_until", sa.Float(), nullable=True),
        sa.Column("cancel_requested", sa.Boolean(), nullable=False),
        sa.Column("fraction", sa.Float(), nullable=False),
        sa.Column("sentence", sa.Text(), nullable=False),
        sa.Column("detail", sa.JSON(), nullable=False),
        sa.Column("result", sa.JSON(), nullable=True),
        sa.Column("error", sa.Text(), nullable=True),
        sa.Column("created_at", TIME, nullable=False),
        sa.Column("started_at", TIME, nullable=True),
        sa.Column("finished_at", TIME, nullable=True),
        sa.Column("updated_at", TIME, nullable=False),
        sa.Column("traceback", sa.Text(), nullable=True),
        sa.Column("row_sha256", NAME, nullable=False, server_default=""),
        sa.PrimaryKeyConstraint("id", name="pk_jobs"),
    )
    op.create_index("ix_jobs_state_created_at", "jobs", ["state", "created_at"])
    op.create_table(
        "layouts",
        sa.Column("name", NAME, nullable=False),
        sa.Column("document", sa.JSON(), nullable=False),
        sa.Column("created_at", TIME, nullable=False),
        sa.PrimaryKeyConstraint("name", name="pk_layouts"),
    )
    op.create_table(
        "recordings",
        sa.Column("id", NAME, nullable=False),
        sa.Column("glove", NAME, nullable=False),
        sa.Column("name", sa.Text(), nullable=False),
        sa.Column("subject", NAME, nullable=True),
        sa.Column("wearing", sa.Text(), nullable=True),
        sa.Column("state", sa.String(length=16), nullable=False),
        sa.Column("facts", sa.JSON(), nullable=False),
        sa.Column("requested_at", TIME, nullable=False),
        sa.Column("updated_at", TIME, nullable=False),
        sa.Column("row_sha256", NAME, nullable=False, server_default=""),
        sa.PrimaryKeyConstraint("id", name="pk_recordings"),
    )
    op.create_index("ix_recordings_glove", "recordings", ["glove"])
    op.create_index("ix_recordings_state", "recordings", ["state"])
    op.create_table(
        "revision",
        sa.Column("id", sa.Integer(), autoincrement=False, nullable=False),
        sa.Column("value", sa.BigInteger(), nullable=False),
        sa.PrimaryKeyConstraint("id", name="pk_revision"),
    )
    op.create_table(
        "subjects",
        sa.Column("name", NAME, nullable=False),
        sa.Column("title", sa.Text(), nullable=False),
        sa.Column("dimensions", sa.JSON(), nullable=False),
        sa.Column("created_at", TIME, nullable=False),
        sa.Column("hand", sa.String(8), nullable=False, server_default="right"),
        sa.PrimaryKeyConstraint("name", name="pk_subjects"),
    )
    op.create_table(
        "job_events",
        sa.Column("id", GROWING, autoincrement=True, nullable=False),
        sa.Column("job", NAME, nullable=False),
        sa.Column("attempt", sa.Integer(), nullable=False),
        sa.Column("state", sa.String(length=16), nullable=False),
        sa.Column("fraction", sa.Float(), nullable=False),
        sa.Column("sentence", sa.Text(), nullable=False),
        sa.Column("detail", sa.JSON(), nullable=False),
        sa.Column("created_at", TIME, nullable=False),
        sa.ForeignKeyConstraint(["job"], ["jobs.id"], name="fk_job_events_job", ondelete="CASCADE"),
        sa.PrimaryKeyConstraint("id", name="pk_job_events"),
    )
    op.create_index("ix_job_events_job_id", "job_events", ["job", "id"])
    op.create_table(
        "models",
        sa.Column("id", NAME, nullable=False),
        sa.Column("subject", NAME, nullable=False),
        sa.Column("layout", NAME, nullable=False),
        sa.Column("method", NAME, nullable=False),
        sa.Column("parent", NAME, nullable=True),
        sa.Column("facts", sa.JSON(), nullable=False),
        sa.Column("created_at", TIME, nullable=False),
        sa.Column("hand", sa.String(8), nullable=True),
        sa.Column("row_sha256", NAME, nullable=False),
        sa.ForeignKeyConstraint(["subject"], ["subjects.name"], name="fk_models_subject"),
        sa.PrimaryKeyConstraint("id", name="pk_models"),
    )
    op.create_index("ix_models_subject_layout", "models", ["subject", "layout"])
    op.create_table(
        "takes",
        sa.Column("id", NAME, nullable=False),
        sa.Column("name", sa.Text(), nullable=False),
        sa.Column("subject", NAME, nullable=False),
        sa.Column("layout", NAME, nullable=False),
        sa.Column("wearing", sa.Text(), nullable=False),
        sa.Column("source", NAME, nullable=False),
        sa.Column("artifact", NAME, nullable=False),
        sa.Column("frames_sha256", NAME, nullable=False),
        sa.Column("original_sha256", NAME, nullable=True),
        sa.Column("sensors", sa.JSON(), nullable=False),
        sa.Column("rotations", sa.JSON(), nullable=False),
        sa.Column("context", sa.JSON(), nullable=False),
        sa.Column("frames", sa.Integer(), nullable=False),
        sa.Column("reference_rows", sa.Integer(), nullable=False),
        sa.Column("duration_s", sa.Float(), nullable=False),
        sa.Column("simulated", sa.Boolean(), nullable=False),
        sa.Column("recording", NAME, nullable=True),
        sa.Column("accounting", sa.JSON(), nullable=True),
        sa.Column("facts", sa.JSON(), nullable=False),
        sa.Column("created_at", TIME, nullable=False),
        sa.Column("row_sha256", NAME, nullable=False, server_default=""),
        sa.ForeignKeyConstraint(["subject"], ["subjects.name"], name="fk_takes_subject"),
        sa.PrimaryKeyConstraint("id", name="pk_takes"),
        sa.UniqueConstraint(
            "subject", "layout", "frames_sha256", name="uq_takes_subject_layout_frames_sha256"
        ),
    )
    op.create_table(
        "activations",
        sa.Column("id", GROWING, autoincrement=True, nullable=False),
        sa.Column("subject", NAME, nullable=False),
        sa.Column("layout", NAME, nullable=False),
        sa.Column("model", NAME, nullable=False),
        sa.Column("kind", sa.String(length=16), nullable=False),
        sa.Column("previous", GROWING, nullable=True),
        sa.Column("created_at", TIME, nullable=False),
        sa.Column("hand", sa.String(8), nullable=True),
        sa.Column("row_sha256", NAME, nullable=False),
        sa.ForeignKeyConstraint(["model"], ["models.id"], name="fk_activations_model"),
        sa.ForeignKeyConstraint(["subject"], ["subjects.name"], name="fk_activations_subject"),
        sa.PrimaryKeyConstraint("id", name="pk_activations"),
    )
    op.create_index("ix_activations_subject_layout_id", "activations", ["subject", "layout", "id"])
    op.create_table(
        "model_takes",
        sa.Column("model", NAME, nullable=False),
        sa.Column("take", NAME, nullable=False),
        sa.Column("row_sha256", NAME, nullable=False, server_default=""),
        sa.ForeignKeyConstraint(["model"], ["models.id"], name="fk_model_takes_model"),
        sa.PrimaryKeyConstraint("model", "take", name="pk_model_takes"),
    )
    op.create_index("ix_model_takes_take", "model_takes", ["take"])
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
        sa.Column("row_sha256", NAME, nullable=False, server_default=""),
        sa.ForeignKeyConstraint(["subject"], ["subjects.name"], name="fk_samplings_subject"),
        sa.PrimaryKeyConstraint("id", name="pk_samplings"),
    )
    op.create_index("ix_samplings_open", "samplings", ["open"])
    op.execute("INSERT INTO revision (id, value) VALUES (1, 0)")
