"""Effects that a model can have though they add no columns: each is looked for in the takes instead."""

from __future__ import annotations

CLOCK, SATURATION, SLIP = "clock_offset", "saturation", "garment_slip"
ADDED_BY_SIGNATURE = (CLOCK, "repeated_samples", "sensor_fault", SATURATION, SLIP)
