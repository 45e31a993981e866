"""A few held poses put a stored calibration right for a new wearing."""
