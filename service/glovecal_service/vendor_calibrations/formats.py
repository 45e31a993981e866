"""The formats of other programs' calibrations, by name."""

from __future__ import annotations

from glovecal_models.errors import BadInput
from glovecal_models.names import did_you_mean
from glovecal_service.vendor_calibrations import (
    asr,
    lerobot,
    opengloves,
    shadow_xml,
    shadow_yaml,
    virtualhand,
)
from glovecal_service.vendor_calibrations.calibration_format import CalibrationFormat

FORMATS: dict[str, CalibrationFormat] = {
    one.name: one
    for one in (
        virtualhand.FORMAT,
        asr.FORMAT,
        shadow_xml.FORMAT,
        shadow_yaml.FORMAT,
        opengloves.FORMAT,
        lerobot.FORMAT,
    )
}


def calibration_format(name: str) -> CalibrationFormat:
    """Raises BadInput that lists what there is."""
    if name not in FORMATS:
        raise BadInput(f"no calibration format {name!r}; {did_you_mean(name, FORMATS)}")
    return FORMATS[name]
