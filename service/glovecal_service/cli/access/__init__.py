"""Keys and the log of changes: ``glovecal key``, ``glovecal audit``."""
