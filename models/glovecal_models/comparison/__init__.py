"""A calibration model held against measurements: how far off, where, and how much of that is structure."""
