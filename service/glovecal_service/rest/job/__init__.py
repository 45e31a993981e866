"""Long work: ``/v1/jobs``."""
