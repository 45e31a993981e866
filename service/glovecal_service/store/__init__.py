"""Everything kept on disk: database rows and artifacts. Open it with ``Store.open(settings)``."""

from glovecal_service.store.store import Store

__all__ = ["Store"]
