"""Long work on the service: ``glovecal job``."""
