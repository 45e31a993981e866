"""Keys, people and the log of changes: ``glovecal key``, ``glovecal person``, ``glovecal audit``."""
