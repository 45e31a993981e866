"""Runs the migrations on the connection that ``store/migrate.py`` opened, inside its transaction."""

from alembic import context

from glovecal_service.store.tables import metadata

context.configure(
    connection=context.config.attributes["connection"],
    target_metadata=metadata,
    transactional_ddl=False,
    render_as_batch=True,
)
context.run_migrations()
