"""Times that are not seconds, told by the rate they would mean."""

from __future__ import annotations

SLOWEST_STEP_S = 1.5
"""Single poses set by hand come about once a second; a glove of 5 Hz or more in ms is above."""
FASTEST_RATE_HZ = 10_000.0
SLOWEST_RATE_HZ = 5.0
_UNITS = (("milliseconds", 1e3), ("microseconds", 1e6), ("nanoseconds", 1e9))


def time_unit_warning(typical_step: float) -> str | None:
    """A sentence's end on a median step between frames (as if in seconds) that no glove has, else None."""
    if typical_step > SLOWEST_STEP_S:
        return f"one frame every {typical_step:.4g} s. time_s is wanted in seconds{unit_hint(typical_step)}."
    if typical_step < 1.0 / FASTEST_RATE_HZ:
        return (
            f"{1.0 / typical_step:.4g} frames a second. time_s is wanted in seconds; is it in minutes, hours"
            " or days?"
        )
    return None


def unit_hint(typical_step: float) -> str:
    """Which unit would make ``typical_step`` a glove's, as the end of a sentence; "" when none would."""
    for unit, per_second in _UNITS:
        rate_hz = per_second / typical_step
        if SLOWEST_RATE_HZ <= rate_hz <= FASTEST_RATE_HZ:
            return f"; if it is in {unit} ({rate_hz:.4g} Hz), divide by {per_second:.0e}".replace("e+0", "e")
    return ""
