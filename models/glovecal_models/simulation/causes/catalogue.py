"""All causes that can be hidden, by name, and the forms of each."""

from __future__ import annotations

from importlib import import_module

from glovecal_models.errors import BadInput
from glovecal_models.simulation.causes.form import Form
from glovecal_models.simulation.causes.unknown import FORMS_BY_NAME

KNOWN_CAUSES = (
    "nonlinearity", "cross_coupling", "palm_arch", "hysteresis", "creep", "lag", "clock_offset",
    "repeated_samples", "warmup_drift", "temperature", "humidity", "donning_shift", "garment_slip",
    "supply_sag", "saturation", "contact_pressure", "sensor_fault",
)  # fmt: skip
"""Those with an effect's name; each lives in the file of that name."""
UNKNOWN_CAUSES = tuple(f"unknown:{name}" for name in FORMS_BY_NAME)


def forms(name: str) -> tuple[Form, ...]:
    """The forms of one cause. Raises BadInput for another name."""
    if name in UNKNOWN_CAUSES:
        return FORMS_BY_NAME[name.removeprefix("unknown:")]
    if name not in KNOWN_CAUSES:
        raise BadInput(f"no cause {name!r}; there are {', '.join(KNOWN_CAUSES + UNKNOWN_CAUSES)}")
    return import_module(f"glovecal_models.simulation.causes.{name}").FORMS
