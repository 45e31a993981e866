"""saturation: the sensor stops responding near the end of its range."""
