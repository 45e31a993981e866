"""Calibrations of other programs, read from their files and written to them: one file a format."""
