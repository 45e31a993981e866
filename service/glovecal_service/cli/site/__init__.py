"""A site of several computers: ``glovecal site``."""
