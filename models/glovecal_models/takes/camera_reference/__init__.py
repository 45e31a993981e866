"""A camera as the reference of a take: its estimates, their clock, and the range that they cover."""
