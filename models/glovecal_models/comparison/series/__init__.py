"""A model and measurements over time."""
