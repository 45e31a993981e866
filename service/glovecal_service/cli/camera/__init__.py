"""A camera and the printed colour glove: ``glovecal camera``."""
