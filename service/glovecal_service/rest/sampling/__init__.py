"""Guided sampling, and what to record next: ``/v1/sampling``, ``/v1/models/{id}/next-steps``."""
