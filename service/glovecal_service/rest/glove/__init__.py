"""Layouts, the gloves that were seen, and recordings: ``/v1/gloves``, ``/v1/recordings``."""
