"""The people whose hands are calibrated: ``/v1/subjects``."""
